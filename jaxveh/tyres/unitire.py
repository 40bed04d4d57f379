"""UniTire: one exponential of the normalised slip for all loads, frictions and directions."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.slip import theoretical
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses

SATURATED = 40.0
"""The normalised slip from which on the exponential is zero in float64, for any E."""


class UniTire(AbstractTwoStiffnesses):
    """UniTire in combined slip (K. Guo & D. Lu, UniTire: unified tire model, Vehicle System Dynamics 45 S1, 2007, 79-99).

    `slip_stiffness` K_x (N), `cornering_stiffness` K_y (N/rad), `friction` (-), curvature factor `E` (-; default 0).
    With theoretical slips sigma and the normalised slip `phi = |K sigma| / (mu F_z)` the force is
    `mu F_z (1 - exp(-phi - E phi^2 - (E^2 + 1/12) phi^3))` along `K sigma`; it rises with phi for every E.

    This is the steady, speed-independent form: friction is one number for both directions (in the source it falls with sliding
    speed), K and E do not depend on the load, and the force always has the direction of the normalised slips.

    **Raises** `InputError` for stiffnesses or friction that are not positive, or a contact without a load.
    """

    E: jax.Array = parameter("-", scale=0.5, default=0.0)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        limit = self.limit(contact)
        sigma_x, sigma_y = theoretical(contact)
        wish_x, wish_y, wish = self.unbounded_force(sigma_x, sigma_y)
        held = limit > 0
        phi = wish / numerics.or_one(limit, held)
        rises = (phi < SATURATED) & held
        phi = jnp.where(rises, phi, SATURATED)
        exponent = 1 + self.E * phi + (self.E**2 + 1 / 12) * phi**2
        slides = phi > 0
        force = -jnp.expm1(-phi * exponent) / numerics.or_one(phi, slides)
        share = jnp.where(slides, force, 1.0)
        share = jnp.where(rises, share, limit / numerics.or_one(wish, wish > 0))
        return Forces(F_x=share * wish_x, F_y=share * wish_y)
