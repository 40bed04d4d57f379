"""Fiala's tyre: the lateral force is a cubic of the slip angle's tangent, within the friction that F_x leaves."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses

LEAST_SHARE = 0.01
"""The square of the least share of friction that remains for the lateral force, however large the longitudinal force is."""


class Fiala(AbstractTwoStiffnesses):
    """Fiala (1954) with longitudinal coupling (Hindiyeh & Gerdes, J. Dyn. Sys. Meas. Control 136, 2014, eqs 3 to 6).

    `slip_stiffness` (N), `cornering_stiffness` (N/rad), `friction` (-), `half_length` (m). `F_x = C_x kappa` within
    `+- mu F_z`. The remaining friction `f = sqrt((mu F_z)^2 - F_x^2)`, at least a tenth of `mu F_z`, bounds the lateral force:
    `F_y = f (q - q^2 / 3 + q^3 / 27)` with `q = C tan(alpha) / f` up to q = 3, and f beyond. Without F_x this is the form of
    ADAMS (erratum: the model-adaptive paper prints coefficients of an interpolation instead). `M_z` is that of the brush model.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    half_length: jax.Array = positive("m", default=0.06)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x, F_y (N) and M_z (N m)."""
        limit = self.limit(contact)
        F_x = jnp.clip(self.slip_stiffness * contact.slip_ratio, -limit, limit)
        held = limit > 0
        share = F_x / numerics.or_one(limit, held)
        left = limit * numerics.sqrt(jnp.maximum(1 - share**2, LEAST_SHARE))
        wish = self.cornering_stiffness * numerics.tan(numerics.as_wide_as(contact.slip_angle, left))
        q = jnp.abs(wish) / numerics.or_one(left, held)
        sticks = (q < 3) & held
        q = jnp.where(sticks, q, 3.0)
        F_y = jnp.where(sticks, wish * (1 - q / 3 + q**2 / 27), jnp.sign(wish) * left)
        M_z = -self.half_length * wish / 3 * jnp.where(sticks, (1 - q / 3) ** 3, 0.0)
        return Forces(F_x=F_x, F_y=F_y, M_z=contact.direction * M_z)
