"""The HSRI tyre: Dugoff's law as the Highway Safety Research Institute writes it."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load
from jaxveh.tyres.slip import theoretical


class HSRI(AbstractTyre):
    """The HSRI model (J. T. Tielking & N. K. Mital, UM-HSRI-PF-74-2, 1974), as eq. 4 of the sideslip review writes it.

    `slip_stiffness` (N), `cornering_stiffness` (N/rad), `friction` (-). With theoretical slips sigma (in the source
    `lambda / (1 - lambda)` and `tan(alpha) / (1 - lambda)`, lambda positive when braking) and
    `H = |C sigma| / (mu F_z)` the forces are `C sigma (1 / H - 1 / (4 H^2))` where H > 1/2, else `C sigma`.

    Errata of the review (Chen, Gao & Xu, 2013): in H the lateral term is `k_alpha tan(alpha) / ((1 - lambda) mu F_z)`, without
    the numerator lambda; and the branch H > 1/2 is not printed. With these it is `Dugoff` without fading, H = 1 / (2 l).

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    slip_stiffness: jax.Array = positive("N")
    cornering_stiffness: jax.Array = positive("N/rad")
    friction: jax.Array = positive("-", default=1.0)

    def __check_init__(self):
        check_parameters(self)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        limit = self.friction * contact.friction * need_load(contact, "HSRI")
        sigma_x, sigma_y = theoretical(contact)
        wish_x, wish_y = self.slip_stiffness * sigma_x, self.cornering_stiffness * sigma_y
        wish = numerics.hypot(wish_x, wish_y)
        slips = 2 * wish > limit
        inverse_H = limit / jnp.where(slips, wish, 1.0)
        share = jnp.where(slips, inverse_H - inverse_H**2 / 4, 1.0)
        return Forces(F_x=share * wish_x, F_y=share * wish_y)
