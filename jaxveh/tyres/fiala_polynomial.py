"""Fiala's tyre as printed in the paper of the model-adaptive particle filter: polynomials fitted to the forces and the moment."""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses

FORCE = (1.0, -0.0668, -0.1032)
MOMENT = (0.2749, -0.0950, -0.0872, 0.0353)
PEAK = (FORCE[1] + math.sqrt(FORCE[1] ** 2 - 3 * FORCE[2])) / (-3 * FORCE[2])
"""The normalised slip angle at which the polynomial of the force is greatest, 1.594."""
TAIL = 2.0
"""The normalised slip angle beyond which the moment falls as a hyperbola."""
POLE = 0.32


class FialaPolynomial(AbstractTwoStiffnesses):
    """The Fiala tyre of Qin et al. (2014, a model-adaptive particle filter for vehicle states), eqs. 9 to 11.

    `slip_stiffness` (N), `cornering_stiffness` (N/rad), `friction` (-), `trail` e (m) at zero slip, `contact_length` L_r (m;
    None: `e / 0.2749`). With `theta = C tan(alpha) / (mu F_z)`, its magnitude q, and the sign of theta:

    - `F_x = C_x kappa`, within `+- mu F_z`;
    - `F_y = mu F_z (q - 0.0668 q^2 - 0.1032 q^3)` up to its peak at q = 1.594, then constant at the peak's 1.0063 mu F_z;
    - `M_z = -mu F_z L_r (0.2749 q - 0.0950 q^2 - 0.0872 q^3 + 0.0353 q^4)` up to q = 2, then falling as `1 / (q - 0.32)`.

    `as_printed=True` follows the paper to the letter except for its signs: F_x without limit; F_y with its branch at 1.54, where
    it jumps by 0.2 per cent; and beyond q = 2 the moment `0.2258 mu F_z e / (q - 0.32)`, with a jump at q = 2.

    Errata: the sign of eq. 10; |theta|; the jump of the moment, which is 64 per cent with the printed L_r of 70 mm and e of
    31.7 mm (with `e / 0.2749`, 115 mm, it is 0.1 per cent and e is the trail at zero slip, so 70 mm is probably a misprint);
    the printed C_x of 1200 N is unusably small. These polynomials approximate the law of ADAMS, `Fiala`. They lie above it, by
    up to 14 per cent of mu F_z at q = 1.3.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    trail: jax.Array = positive("m", default=0.0317)
    contact_length: jax.Array | None = positive("m", default=None)
    as_printed: bool = eqx.field(static=True, default=False)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x, F_y (N) and M_z (N m)."""
        limit = self.limit(contact)
        F_x = self.slip_stiffness * contact.slip_ratio
        if not self.as_printed:
            F_x = jnp.clip(F_x, -limit, limit)
        wish = self.cornering_stiffness * numerics.tan(numerics.as_wide_as(contact.slip_angle, limit))
        M_z = contact.direction * self._moment(wish, limit)
        return Forces(F_x=F_x, F_y=self._lateral(wish, limit), M_z=M_z)

    def _lateral(self, wish, limit):
        branch, most = (1.54, 1.0063) if self.as_printed else (PEAK, PEAK * _polynomial(FORCE, PEAK))
        q, rises = _clip_theta(wish, limit, branch)
        return jnp.where(rises, wish * _polynomial(FORCE, q), jnp.sign(wish) * most * limit)

    def _moment(self, wish, limit):
        length = self.trail / MOMENT[0] if self.contact_length is None else self.contact_length
        if self.as_printed:
            height = 0.2258 * self.trail
        else:
            height = length * TAIL * _polynomial(MOMENT, TAIL) * (TAIL - POLE)
        q, rises = _clip_theta(wish, limit, TAIL)
        # mu F_z / (q - 0.32), without dividing by the limit.
        beyond = limit**2 / jnp.where(rises | (wish == 0), 1.0, jnp.abs(wish) - POLE * limit)
        return -jnp.where(rises, wish * length * _polynomial(MOMENT, q), jnp.sign(wish) * height * beyond)


def _clip_theta(wish, limit, branch: float):
    """|theta|, at most `branch`, and whether it lies below that."""
    held = limit > 0
    q = jnp.abs(wish) / numerics.or_one(limit, held)
    below = (q < branch) & held
    return jnp.where(below, q, branch), below


def _polynomial(coefficients, q):
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = coefficient + q * total
    return total
