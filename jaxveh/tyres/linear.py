"""The linear tyre: the baseline with which every other law agrees at small slip."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces


class Linear(AbstractTyre):
    """`F_y = cornering_stiffness * slip_angle` and `F_x = slip_stiffness * slip_ratio`, both without limit.

    `cornering_stiffness` (N/rad), `slip_stiffness` (N; None: no longitudinal force). Load, friction and camber have no effect.

    **Raises** `InputError` for stiffnesses that are not positive.
    """

    cornering_stiffness: jax.Array = positive("N/rad")
    slip_stiffness: jax.Array | None = positive("N", default=None)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_y, N, in the shape of the slip angle; with a slip stiffness F_x, N, in the shape of the slip ratio."""
        F_y = self.cornering_stiffness * contact.slip_angle
        if self.slip_stiffness is None:
            return Forces(F_y=F_y)
        return Forces(F_x=self.slip_stiffness * contact.slip_ratio, F_y=F_y)
