"""The force along the road that the torques at a car's wheels make."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import parameter, positive


class AbstractDriveForce(eqx.Module):
    """A car whose torques act over `wheel_radius` (m) against the air (`drag`, N s^2/m^2), the rotation of its four wheels
    (`wheel_inertia`, kg m^2, of one) and `rolling_resistance` (-)."""

    _: KW_ONLY
    wheel_radius: jax.Array = positive("m")
    wheel_inertia: jax.Array = positive("kg m^2", default=1.2)
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4, default=0.4)
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.012)

    def spin_up(self, v_x_rate: Any) -> Any:
        """The force that accelerates the wheels' rotation at a rate of the speed (m/s^2), N."""
        return 4.0 * self.wheel_inertia / jnp.square(self.wheel_radius) * v_x_rate

    def drive_force(self, torque: Any, v_x: Any, v_x_rate: Any) -> Any:
        """The force along the road (N) of the `torque` at all wheels (N m) at a speed (m/s) and its rate, without rolling
        resistance, which is proportional to the mass."""
        return torque / self.wheel_radius - self.drag * v_x * jnp.abs(v_x) - self.spin_up(v_x_rate)
