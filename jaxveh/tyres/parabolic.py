"""The parabolic tyre: a parabola up to the friction limit, and the friction circle for combined slip."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load


class Parabolic(AbstractTyre):
    """`F_y = (C alpha - C^2 alpha |alpha| / (4 mu F_z)) sqrt(1 - (F_x / (mu F_z))^2)` up to `|alpha| = 2 mu F_z / C`, its peak.

    R. Chumsamutr, T. Fujioka & M. Abe, Vehicle System Dynamics 44(7), 2006; eq. 5 of the sideslip review (Chen, Gao & Xu,
    2013; erratum: it has the opposite sign of the review's eqs. 6 and 7).

    - `cornering_stiffness` (N/rad), `friction` (-).
    - `slip_stiffness` (N): of the same parabola in slip ratio, which gives F_x; None for no longitudinal force. The source takes
      F_x as known. This law is our own choice; with it the total force stays within `mu F_z`. If F_x uses all of the friction
      (a locked wheel), there is no lateral force.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    cornering_stiffness: jax.Array = positive("N/rad")
    friction: jax.Array = positive("-", default=1.0)
    slip_stiffness: jax.Array | None = positive("N", default=None)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_y (N), and F_x (N) where a slip stiffness is given."""
        limit = self.friction * contact.friction * need_load(contact, "Parabolic")
        F_y, _ = _parabola(self.cornering_stiffness * contact.slip_angle, limit)
        if self.slip_stiffness is None:
            return Forces(F_y=F_y)
        F_x, q = _parabola(self.slip_stiffness * contact.slip_ratio, limit)
        # sqrt(1 - (F_x / limit)^2), in a form without infinite slope where F_x uses all of the friction.
        left = (1 - q) * numerics.sqrt(1 + q * (2 - q))
        return Forces(F_x=F_x, F_y=left * F_y)


def _parabola(wish, limit):
    """The force of the linear force `wish` (`C slip`) under a limit, and the slip over the slip of the peak, at most 1."""
    held = limit > 0
    q = jnp.abs(wish) / numerics.or_one(2 * limit, held)
    sticks = (q < 1) & held
    q = jnp.where(sticks, q, 1.0)
    return jnp.where(sticks, wish * (1 - q / 2), jnp.sign(wish) * limit), q
