"""Dugoff's tyre: combined slip with uniform pressure and one friction coefficient."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_at_least
from jaxveh._core.parameter import parameter
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.slip import theoretical
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses


class Dugoff(AbstractTwoStiffnesses):
    """The model of Dugoff, Fancher & Segel (SAE 700377, 1970), with slip ratios that are positive when driving.

    `slip_stiffness` (N), `cornering_stiffness` (N/rad), `friction` (-), `fading` (s/m; default 0): friction falls with sliding
    speed as `mu (1 - fading V |slip|)`. With theoretical slips sigma and `l = mu F_z / (2 |C sigma|)` the forces are
    `C sigma l (2 - l)` where l < 1, and `C sigma` otherwise.

    **Raises** `InputError` for parameters out of range, or a contact without a load (with `fading`: without a speed).
    """

    fading: jax.Array | None = parameter("s/m", scale=0.01, default=None)

    def __check_init__(self):
        if self.fading is not None:
            check_at_least("Dugoff.fading", self.fading, 0.0)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        limit = self.limit(contact)
        sigma_x, sigma_y = theoretical(contact)
        if self.fading is not None:
            limit = limit * self._friction_share(contact, sigma_y)
        wish_x, wish_y, wish = self.unbounded_force(sigma_x, sigma_y)
        slips = 2 * wish > limit
        part = jnp.where(slips, limit / numerics.or_one(2 * wish, slips), 1.0)
        share = part * (2 - part)
        return Forces(F_x=share * wish_x, F_y=share * wish_y)

    def _friction_share(self, contact: Contact, like):
        """The share of friction that remains at the sliding speed."""
        if contact.speed is None:
            raise InputError("contact.speed = None: Dugoff with fading needs the wheel's speed in m/s.")
        tangent = numerics.tan(numerics.as_wide_as(contact.slip_angle, like))
        slides = numerics.hypot(numerics.as_wide_as(contact.slip_ratio, like), tangent)
        return jnp.maximum(1 - self.fading * contact.speed * slides, 0.0)
