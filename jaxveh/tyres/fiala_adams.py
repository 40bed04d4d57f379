"""Fiala's tyre as in ADAMS: both directions are independent, and friction falls with the total slip."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import Contact, Forces, need_load
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses


class FialaADAMS(AbstractTwoStiffnesses):
    """The Fiala model of MSC ADAMS (Adams Tire, Using the Fiala Handling Force Model), in this package's signs.

    `slip_stiffness` (N), `cornering_stiffness` (N/rad), `friction` (-; UMAX, at zero slip), `sliding_friction` (-; UMIN, at the
    slip 1, None for constant friction), `half_width` (m; R_2 of the carcass, which scales the aligning moment).

    With `S = sqrt(kappa^2 + tan(alpha)^2)`, at most 1, `mu = UMAX - (UMAX - UMIN) S`:

    - `F_x = C_x kappa` up to `|kappa| = mu F_z / (2 C_x)`, then `mu F_z - (mu F_z)^2 / (4 |kappa| C_x)` with kappa's sign.
    - With `H = 1 - C |tan(alpha)| / (3 mu F_z)`: `F_y = mu F_z (1 - H^3)` and `M_z = -2 R_2 mu F_z (1 - H) H^3`, with alpha's
      sign, as long as H > 0; beyond that `mu F_z` and 0.

    The two directions do not share the friction: the total force reaches `sqrt(2) mu F_z`. `Fiala` couples them.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    sliding_friction: jax.Array | None = positive("-", default=None)
    half_width: jax.Array = positive("m", default=0.1)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x, F_y (N) and M_z (N m)."""
        load = need_load(contact, "FialaADAMS")
        kappa = numerics.as_wide_as(contact.slip_ratio, load)
        tangent = numerics.tan(numerics.as_wide_as(contact.slip_angle, load))
        limit = self._friction(kappa, tangent) * contact.friction * load
        F_x = self._longitudinal(kappa, limit)

        wish = self.cornering_stiffness * tangent
        held = limit > 0
        q = jnp.abs(wish) / numerics.or_one(3 * limit, held)
        sticks = (q < 1) & held
        H = jnp.where(sticks, 1 - q, 0.0)
        # mu F_z (1 - H^3) and mu F_z (1 - H), where `wish` is 3 mu F_z (1 - H).
        F_y = jnp.where(sticks, wish * (1 + H + H**2) / 3, jnp.sign(wish) * limit)
        M_z = -2 * self.half_width * wish / 3 * H**3
        return Forces(F_x=F_x, F_y=F_y, M_z=contact.direction * M_z)

    def _friction(self, kappa, tangent):
        if self.sliding_friction is None:
            return self.friction
        slip = jnp.minimum(numerics.hypot(kappa, tangent), 1.0)
        return self.friction - (self.friction - self.sliding_friction) * slip

    def _longitudinal(self, kappa, limit):
        wish = self.slip_stiffness * kappa
        slips = 2 * jnp.abs(wish) > limit
        part = jnp.where(slips, limit / numerics.or_one(2 * jnp.abs(wish), slips), 1.0)
        return wish * part * (2 - part)
