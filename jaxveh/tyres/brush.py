"""The brush tyre: bristles that stick up to the friction limit of a parabolic pressure distribution."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check_one_of
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.slip import theoretical
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses

SLIDES = ("along deflection", "against velocity")


class Brush(AbstractTwoStiffnesses):
    """The brush model with parabolic pressure, combined slip (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 3.2).

    `slip_stiffness` (N) and `cornering_stiffness` (N/rad) at small slip, `friction` (-), `half_length` (m) of the contact.
    With theoretical slips sigma and `g = |C sigma| / (3 mu F_z)` bristles stick in the leading part `1 - g` of the contact and
    slide behind it. From g = 1 on all slide.

    `slides`: the direction of the force of a sliding bristle. Both choices are the same if the two stiffnesses are equal:

    - `along deflection` (the default): the force keeps the direction in which the bristle was deflected, `C sigma`. The force
      is `mu F_z (1 - (1 - g)^3)` in that direction, and the trail `a / 3 (1 - g)^3 / (1 - g + g^2 / 3)`.
    - `against velocity`: friction on a sliding bristle points against its velocity, along sigma. The force is
      `(1 - g)^2 C sigma + mu F_z g^2 (3 - 2 g) sigma / |sigma|`. The aligning moment is that of both parts about the
      contact's centre, `-a (1 - g)^2 ((4 (1 - g) / 3 - 1) C_y sigma_y + 3 mu F_z g^2 sigma_y / |sigma|)`. At full sliding this
      is Coulomb's law. J. Svendenius, Tire Modeling and Friction Estimation (thesis, Lund, 2007), compares both.

    The forces of the two choices differ in each direction by up to 11 % of `mu F_z` if one stiffness is 4/3 of the other, and
    by up to 26 % if it is twice the other. The difference is largest at full sliding.

    **Raises** `InputError` for parameters that are not positive, an unknown `slides`, or a contact without a load.
    """

    half_length: jax.Array = positive("m", default=0.06)
    slides: str = eqx.field(static=True, default="along deflection")

    def __check_init__(self):
        check_one_of("Brush.slides", self.slides, SLIDES)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x, F_y (N) and M_z (N m)."""
        limit = self.limit(contact)
        sigma_x, sigma_y = theoretical(contact)
        wish_x, wish_y, wish = self.unbounded_force(sigma_x, sigma_y)
        held = limit > 0
        g = wish / numerics.or_one(3 * limit, held)
        sticks = (g < 1) & held
        g = jnp.where(sticks, g, 1.0)
        if self.slides == "against velocity":
            return self._against_velocity(contact, limit, g, sigma_x, sigma_y)
        share = jnp.where(sticks, 1 - g + g**2 / 3, limit / numerics.or_one(wish, wish > 0))
        F_x, F_y = share * wish_x, share * wish_y
        trail = self.half_length / 3 * (1 - g) ** 3 / (1 - g + g**2 / 3)
        return Forces(F_x=F_x, F_y=F_y, M_z=-contact.direction * trail * F_y)

    def _against_velocity(self, contact: Contact, limit, g, sigma_x, sigma_y) -> Forces:
        slides = numerics.hypot(sigma_x, sigma_y)
        per_slip = limit * g**2 / numerics.or_one(slides, slides > 0)
        rest = 1 - g
        F_x, F_y = (
            (rest**2 * stiffness + per_slip * (3 - 2 * g)) * sigma
            for stiffness, sigma in ((self.slip_stiffness, sigma_x), (self.cornering_stiffness, sigma_y))
        )
        arm = self.half_length * rest**2
        M_z = -arm * ((4 * rest / 3 - 1) * self.cornering_stiffness + 3 * per_slip) * sigma_y
        return Forces(F_x=F_x, F_y=F_y, M_z=contact.direction * M_z)
