"""The HSRI tyre: Dugoff's law in the form of the Highway Safety Research Institute."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.slip import theoretical
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses


class HSRI(AbstractTwoStiffnesses):
    """The HSRI model (J. T. Tielking & N. K. Mital, UM-HSRI-PF-74-2, 1974), in the form of eq. 4 of the sideslip review.

    `slip_stiffness` (N), `cornering_stiffness` (N/rad), `friction` (-). With theoretical slips sigma (in the source
    `lambda / (1 - lambda)` and `tan(alpha) / (1 - lambda)`, lambda positive when braking) and
    `H = |C sigma| / (mu F_z)` the forces are `C sigma (1 / H - 1 / (4 H^2))` where H > 1/2, and `C sigma` otherwise.

    Errata of the review (Chen, Gao & Xu, 2013): in H the lateral term is `k_alpha tan(alpha) / ((1 - lambda) mu F_z)`, without
    the numerator lambda; and the branch H > 1/2 is not printed. With these corrections the model is `Dugoff` without fading,
    H = 1 / (2 l).

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        limit = self.limit(contact)
        sigma_x, sigma_y = theoretical(contact)
        wish_x, wish_y, wish = self.unbounded_force(sigma_x, sigma_y)
        slips = 2 * wish > limit
        inverse_H = limit / numerics.or_one(wish, slips)
        share = jnp.where(slips, inverse_H - inverse_H**2 / 4, 1.0)
        return Forces(F_x=share * wish_x, F_y=share * wish_y)
