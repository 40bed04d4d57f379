"""Slip vectors, and the component of a curve of pure slip in one direction."""

from __future__ import annotations

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.base import Contact

LOCKED = 1e-3
"""The lower bound of the rolling speed over the forward speed: a locked wheel slides a thousand times faster than it rolls."""

SMALLEST = 1e-5
"""The least length of a slip vector, so small that no curve of force over slip distinguishes it from zero."""


def theoretical(contact: Contact):
    """`kappa / (1 + kappa)` and `tan(alpha) / (1 + kappa)`, with the signs of their forces; finite for a locked wheel."""
    s_x, s_y = practical(contact)
    rolls = jnp.maximum(1.0 + s_x, LOCKED)
    return s_x / rolls, s_y / rolls


def practical(contact: Contact):
    """`kappa` and `tan(alpha)`: sliding speed over forward speed, with the signs of their forces."""
    if contact.lateral_slip is None:
        angle = numerics.as_wide_as(contact.slip_angle, contact.slip_ratio)
        return numerics.as_wide_as(contact.slip_ratio, angle), numerics.tan(jnp.asarray(angle))
    tangent = numerics.as_wide_as(contact.lateral_slip, contact.slip_ratio)
    return numerics.as_wide_as(contact.slip_ratio, tangent), tangent


def length(x, y):
    """`sqrt(x^2 + y^2)`, smooth at zero, where it is `SMALLEST`, so that one can divide by it."""
    return jnp.sqrt(x * x + y * y + SMALLEST**2)


def share(curve, part, whole):
    """The component of a curve of pure slip in the direction in which the slip of length `whole` has the component `part`.

    It is `part / whole * (curve(whole) - curve(0))`, with the curve's negative side (`-whole`) where the part is negative.
    """
    signed = jnp.where(part < 0, -whole, whole)
    return part / signed * (curve(signed) - curve(jnp.zeros_like(signed)))
