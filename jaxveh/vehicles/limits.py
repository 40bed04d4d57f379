"""Limits of steering and of acceleration."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check
from jaxveh._core.parameter import check_parameters, parameter, positive


class SteerLimits(eqx.Module):
    """Limits of the steer, `smallest` and `largest` (rad at the road wheels), and of its rate, `slowest` (rad/s, negative) and
    `fastest` (rad/s): the steering constraints of CommonRoad (Althoff & Würsching, CommonRoad: Vehicle Models, 2020).

    **Raises** `InputError` for a limit that is not finite or that has the wrong sign.
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
        """The limited steering rate (rad/s) for a commanded `rate` at the angle `steer` (rad)."""
        stopped = ((steer <= self.smallest) & (rate <= 0)) | ((steer >= self.largest) & (rate >= 0))
        return jnp.where(stopped, 0.0, jnp.clip(rate, self.slowest, self.fastest))


class AccelerationLimits(eqx.Module):
    """Limits of the acceleration by tyres and engine: `largest` (m/s^2) in both directions; above `switching_speed` v_s (m/s) the
    engine's power limits the forward acceleration to `largest v_s / v`. The speed stays between `backwards` (m/s, negative) and
    `forwards` (m/s). The acceleration constraints of CommonRoad (Althoff & Würsching, CommonRoad: Vehicle Models, 2020).

    **Raises** `InputError` for a limit that is not finite or that has the wrong sign.
    """

    largest: jax.Array = positive("m/s^2")
    switching_speed: jax.Array = positive("m/s")
    backwards: jax.Array = parameter("m/s", scale=10.0)
    forwards: jax.Array = positive("m/s")

    def __check_init__(self):
        check_parameters(self)
        check("AccelerationLimits.backwards", self.backwards, lambda v: v < 0, "negative (m/s)")

    def limit(self, speed: Any, acceleration: Any) -> Any:
        """The limited acceleration (m/s^2) for a commanded `acceleration` at a `speed` (m/s)."""
        stopped = ((speed <= self.backwards) & (acceleration <= 0)) | ((speed >= self.forwards) & (acceleration >= 0))
        power = self.largest * self.switching_speed / jnp.maximum(speed, self.switching_speed)
        return jnp.where(stopped, 0.0, jnp.clip(acceleration, -self.largest, power))
