"""The brush tyre: bristles that stick until the parabolic pressure cannot hold them."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load
from jaxveh.tyres.slip import theoretical


class Brush(AbstractTyre):
    """The brush model with parabolic pressure, combined slip (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 3.2).

    `slip_stiffness` (N) and `cornering_stiffness` (N/rad) at small slip, `friction` (-), `half_length` (m) of the contact. With
    theoretical slips sigma and `g = |C sigma| / (3 mu F_z)` the force is `mu F_z (1 - (1 - g)^3)` along `C sigma` while some
    bristles stick (g < 1), and `mu F_z` beyond; the trail is `a / 3 (1 - g)^3 / (1 - g + g^2 / 3)`.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    slip_stiffness: jax.Array = positive("N")
    cornering_stiffness: jax.Array = positive("N/rad")
    friction: jax.Array = positive("-", default=1.0)
    half_length: jax.Array = positive("m", default=0.06)

    def __check_init__(self):
        check_parameters(self)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x, F_y (N) and M_z (N m)."""
        limit = self.friction * contact.friction * need_load(contact, "Brush")
        sigma_x, sigma_y = theoretical(contact)
        wish_x, wish_y = self.slip_stiffness * sigma_x, self.cornering_stiffness * sigma_y
        wish = numerics.hypot(wish_x, wish_y)
        held = limit > 0
        g = wish / jnp.where(held, 3 * limit, 1.0)
        sticks = (g < 1) & held
        g = jnp.where(sticks, g, 1.0)
        share = jnp.where(sticks, 1 - g + g**2 / 3, limit / jnp.where(wish > 0, wish, 1.0))
        F_x, F_y = share * wish_x, share * wish_y
        trail = self.half_length / 3 * (1 - g) ** 3 / (1 - g + g**2 / 3)
        return Forces(F_x=F_x, F_y=F_y, M_z=-contact.direction * trail * F_y)
