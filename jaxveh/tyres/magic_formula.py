"""The Magic Formula with four coefficients and two shifts, for pure lateral slip."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load


class MagicFormula(AbstractTyre):
    """`F_y = D sin(C atan(B x - E (B x - atan(B x)))) + S_v` with `x = slip_angle + S_h`.

    H. B. Pacejka, Tire and Vehicle Dynamics, the general form of the Magic Formula (3rd edition, eqs. 4.6 to 4.8).
    The tyre-parameter paper of Bao, Sabbioni et al. (2015) uses it as its eq. 13, which is missing from the printed
    text.

    - `B` (1/rad) stiffness factor, `C` (-) shape factor, `D` (N) peak factor: all positive; `E` (-) curvature factor.
    - `S_h` (rad) horizontal and `S_v` (N) vertical shift, default 0.
    - `nominal_load` (N): if given, the force is proportional to `load / nominal_load`. Without it `D` is the peak force of the
      axle (or wheel) at any load.

    The contact's friction multiplies D and S_v, so that there is no force without friction. Camber, slip ratio and speed have
    no effect. A positive slip angle gives a positive force, as everywhere in this package; files in ISO-W axes have the
    opposite sign.

    **Raises** `InputError` for B, C, D or nominal_load not positive, or a coefficient that is not finite.
    """

    B: jax.Array = positive("1/rad")
    C: jax.Array = positive("-")
    D: jax.Array = positive("N")
    E: jax.Array = parameter("-", scale=2.0)
    S_h: jax.Array = parameter("rad", scale=0.02, default=0.0)
    S_v: jax.Array = parameter("N", scale=500.0, default=0.0)
    nominal_load: jax.Array | None = positive("N", default=None)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The lateral force only, N, in the shape to which slip angle, load and friction broadcast."""
        x = self.B * (contact.slip_angle + self.S_h)
        bent = x - self.E * (x - numerics.arctan(x))
        F_y = self.D * numerics.sin(self.C * numerics.arctan(bent)) + self.S_v
        return Forces(F_y=self._scale(contact) * F_y)

    def _scale(self, contact: Contact):
        if self.nominal_load is None:
            return contact.friction
        return contact.friction * (need_load(contact, "MagicFormula with a nominal_load") / self.nominal_load)

    @property
    def cornering_stiffness(self) -> jax.Array:
        """`B C D`, N/rad: the slope at `x = 0`, at nominal load and full friction."""
        return self.B * self.C * self.D

    @property
    def peak(self) -> jax.Array:
        """The largest force of the law without `S_v`, N, at nominal load and full friction.

        It is D if `C atan(.)` reaches a quarter turn, which is so for C >= 1 and E <= 1. For E > 1 the inner function has its
        maximum at `B x = 1 / sqrt(E - 1)`.
        """
        root = numerics.sqrt(jnp.maximum(self.E - 1.0, 0.0))
        turning = self.E * numerics.arctan2(jnp.ones_like(root), root) - root
        inner = jnp.where(self.E < 1.0, math.pi / 2, numerics.arctan(turning))
        return self.D * numerics.sin(jnp.minimum(self.C * inner, math.pi / 2))
