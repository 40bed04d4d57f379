"""The common part of tyres with two stiffnesses, longitudinal and lateral, and one friction."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, need_load


class AbstractTwoStiffnesses(AbstractTyre):
    """A tyre with `slip_stiffness` (N), `cornering_stiffness` (N/rad) and `friction` (-; default 1, equal in all directions)."""

    slip_stiffness: jax.Array = positive("N")
    cornering_stiffness: jax.Array = positive("N/rad")
    friction: jax.Array = positive("-", default=1.0)

    def limit(self, contact: Contact) -> Any:
        """The greatest force, N: friction of tyre and road times the load."""
        return self.friction * contact.friction * need_load(contact, type(self).__name__)

    def unbounded_force(self, sigma_x: Any, sigma_y: Any) -> tuple[Any, Any, Any]:
        """The force without a friction limit, N: its longitudinal and lateral component and its magnitude."""
        F_x, F_y = self.slip_stiffness * sigma_x, self.cornering_stiffness * sigma_y
        return F_x, F_y, numerics.hypot(F_x, F_y)
