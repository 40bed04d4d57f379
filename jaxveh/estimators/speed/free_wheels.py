"""Speed as the integral of a rate, corrected where the wheels roll freely."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.speed.wheels import AbstractWheelMethod, Wheels


class AbstractFreeWheels(AbstractWheelMethod):
    """The integral of a rate, from the speed at which the wheels last rolled freely.

    Wheels roll freely where they agree, their mean rate is within `free_rate` (m/s^2) of the integrated one, and the car's
    acceleration is below `free_acceleration` (m/s^2). Then the speed follows their mean with the time constant `wheel_time` (s).
    """

    free_rate: jax.Array = positive("m/s^2", default=1.5)
    free_acceleration: jax.Array = positive("m/s^2", default=2.0)
    wheel_time: jax.Array = positive("s", default=0.05)

    def integrate(self, v_x: Any, wheels: Wheels, step: Any, rate: Any, acceleration: Any) -> tuple[Any, Any, Any]:
        """The speed (m/s) after `step` (s) at this `rate` (m/s^2); whether the wheels roll freely; and the excess of their mean
        rate over it (m/s^2). `acceleration`: the car's, by the rate or by the wheels, m/s^2."""
        strange = wheels.mean_rate - rate
        free = self.agree(wheels) & (jnp.abs(strange) < self.free_rate)
        free = free & (jnp.abs(acceleration) < self.free_acceleration)
        v_x = v_x + step * rate
        follows = v_x + (1.0 - jnp.exp(-step / self.wheel_time)) * (wheels.mean - v_x)
        return jnp.where(free, follows, v_x), free, strange
