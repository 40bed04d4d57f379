"""The linear tyre whose stiffness depends on the load: the effect of load transfer on an axle at small slip."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load


class LinearWithLoad(AbstractTyre):
    """`F_y = C(F_z) slip_angle` with the Magic Formula's `C = C_max sin(2 atan(F_z / F_peak))`.

    H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., eq. 4.E25 without camber and pressure. At small load the stiffness is
    `2 C_max / F_peak` times the load. It is greatest at `F_peak` and falls beyond.

    - `cornering_stiffness` (N/rad): C_max, the greatest cornering stiffness.
    - `peak_load` (N): F_peak, the load at which the stiffness is greatest.
    - `slip_stiffness_factor` (-): slip stiffness over load, `F_x = factor F_z slip_ratio` (eq. 4.E15 to first order); None for no
      longitudinal force.

    The forces have no limit; friction and camber have no effect.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    cornering_stiffness: jax.Array = positive("N/rad")
    peak_load: jax.Array = positive("N")
    slip_stiffness_factor: jax.Array | None = positive("-", default=None)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_y (N), and F_x (N) where a slip stiffness is given."""
        load = need_load(contact, "LinearWithLoad")
        x = load / self.peak_load
        # sin(2 atan(x)), without trigonometry.
        stiffness = self.cornering_stiffness * 2 * x / (1 + x**2)
        F_y = stiffness * contact.slip_angle
        if self.slip_stiffness_factor is None:
            return Forces(F_y=F_y)
        return Forces(F_x=self.slip_stiffness_factor * load * contact.slip_ratio, F_y=F_y)
