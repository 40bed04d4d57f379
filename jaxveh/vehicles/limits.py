"""What a driver and a drive cannot do: limits of steering and of acceleration."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check
from jaxveh._core.parameter import check_parameters, parameter, positive


class SteerLimits(eqx.Module):
    """Steering that stops at `smallest` and `largest` (rad at the road wheels) and turns no faster than `slowest` (negative) to
    `fastest` (rad/s): the steering constraints of CommonRoad (Althoff & Würsching, CommonRoad: Vehicle Models, 2020).

    **Raises** `InputError` where a limit is not finite or lies on the wrong side of zero.
    """

    smallest: jax.Array = parameter("rad", scale=1.0)
    largest: jax.Array = positive("rad")
    slowest: jax.Array = parameter("rad/s", scale=1.0)
    fastest: jax.Array = positive("rad/s")

    def __check_init__(self):
        check_parameters(self)
        for name in ("smallest", "slowest"):
            check(f"SteerLimits.{name}", getattr(self, name), lambda v: v < 0, "negative")

    def limit(self, steer: Any, rate: Any) -> Any:
        """The steering rate (rad/s) that becomes of the wished `rate` at the angle `steer` (rad)."""
        stopped = ((steer <= self.smallest) & (rate <= 0)) | ((steer >= self.largest) & (rate >= 0))
        return jnp.where(stopped, 0.0, jnp.clip(rate, self.slowest, self.fastest))


class AccelerationLimits(eqx.Module):
    """Tyres and engine: `largest` (m/s^2) either way, forwards above `switching_speed` (m/s) only `largest v_s / v`, the engine's
    power; no further than the speeds `backwards` (negative) and `forwards` (m/s): the acceleration constraints of CommonRoad
    (Althoff & Würsching, CommonRoad: Vehicle Models, 2020).

    **Raises** `InputError` where a limit is not finite or lies on the wrong side of zero.
    """

    largest: jax.Array = positive("m/s^2")
    switching_speed: jax.Array = positive("m/s")
    backwards: jax.Array = parameter("m/s", scale=10.0)
    forwards: jax.Array = positive("m/s")

    def __check_init__(self):
        check_parameters(self)
        check("AccelerationLimits.backwards", self.backwards, lambda v: v < 0, "negative (m/s)")

    def limit(self, speed: Any, acceleration: Any) -> Any:
        """The acceleration (m/s^2) that becomes of the wished one at a speed (m/s)."""
        stopped = ((speed <= self.backwards) & (acceleration <= 0)) | ((speed >= self.forwards) & (acceleration >= 0))
        power = self.largest * self.switching_speed / jnp.maximum(speed, self.switching_speed)
        return jnp.where(stopped, 0.0, jnp.clip(acceleration, -self.largest, power))
