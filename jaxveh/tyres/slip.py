"""Slips in their theoretical form: sliding speed over rolling speed."""

from __future__ import annotations

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.base import Contact

LOCKED = 1e-3
"""The least rolling speed over forward speed: a locked wheel slides a thousand times faster than it rolls."""


def theoretical(contact: Contact):
    """`kappa / (1 + kappa)` and `tan(alpha) / (1 + kappa)`, positive like their forces; finite for a locked wheel."""
    angle = contact.slip_angle + 0.0 * contact.slip_ratio
    rolls = jnp.maximum(1.0 + contact.slip_ratio + 0.0 * angle, LOCKED)
    return contact.slip_ratio / rolls, numerics.tan(jnp.asarray(angle)) / rolls
