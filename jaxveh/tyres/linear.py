"""The linear tyre: the baseline that every other law agrees with at small slip."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import check_parameters, positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces


class Linear(AbstractTyre):
    """`F_y = cornering_stiffness * slip_angle` (N/rad), without limit: load, friction and camber do not count."""

    cornering_stiffness: jax.Array = positive("N/rad")

    def __check_init__(self):
        check_parameters(self)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """Lateral force alone, N, in the shape of the slip angle."""
        return Forces(F_y=self.cornering_stiffness * contact.slip_angle)
