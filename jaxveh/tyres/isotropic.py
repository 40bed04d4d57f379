"""The Magic Formula over the length of the slip vector: one curve for all directions of sliding."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load
from jaxveh.tyres.slip import length, practical


class IsotropicMagicFormula(AbstractTyre):
    """Combined slip from one Magic Formula: the force opposes the sliding, and its size depends on the size of the slip only.

        F = mu F_z sin(C arctan(x - E (x - arctan(x)))),    x = |(x_x, x_y)| = B |(kappa, tan(alpha))|,    F_i = F x_i / x

    The general form of H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., eqs. 4.6 to 4.8, with the length of the slip vector
    in place of the slip. The tyre has the same stiffness and friction in both directions. It is the cheapest law of combined
    slip.

    - `B` (-) stiffness factor, `C` (-) shape factor: positive; `E` (-) curvature factor.
    - `friction` (-): the peak force over the load, positive.

    The slope at zero slip is `B C mu F_z` in both directions. Camber and speed have no effect, and there are no moments.

    **Raises** `InputError` for B, C or friction not positive, a coefficient that is not finite, or a contact without a load.
    """

    B: jax.Array = positive("-")
    C: jax.Array = positive("-")
    friction: jax.Array = positive("-", default=1.0)
    E: jax.Array = parameter("-", scale=2.0, default=0.0)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        limit = self.friction * contact.friction * need_load(contact, "IsotropicMagicFormula")
        s_x, s_y = practical(contact)
        # The slips are scaled before the length is computed, so that the curve and the direction use the same length.
        x_x, x_y = self.B * s_x, self.B * s_y
        x = length(x_x, x_y)
        bent = x - self.E * (x - numerics.arctan(x))
        per_slip = limit * numerics.sin(self.C * numerics.arctan(bent)) / x
        return Forces(F_x=per_slip * x_x, F_y=per_slip * x_y)
