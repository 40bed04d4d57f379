"""The contract of a manoeuvre: the driver's inputs as a function of time."""

from __future__ import annotations

import abc
import math
from dataclasses import KW_ONLY
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check, check_at_least, check_finite, check_positive
from jaxveh._core.parameter import parameter
from jaxveh.numerics import smooth_step


class DriverInputs(NamedTuple):
    """`steer` (rad at the road wheels, positive to the left), the speed `v_x` (m/s) and its rate `v_x_rate` (m/s^2)."""

    steer: Any
    v_x: Any
    v_x_rate: Any


class PedalInputs(NamedTuple):
    """`DriverInputs` with pedals.

    `drive_torque` and `brake_torque` (N m, never negative): totals at the wheels.
    """

    steer: Any
    v_x: Any
    v_x_rate: Any
    drive_torque: Any
    brake_torque: Any


class AbstractManoeuvre(eqx.Module):
    """The driver's inputs as a function of time from t = 0 to `duration` (s). Array leaves are its parameters.

    `adds_to_pedals`: its torques are added to the pedals of a `SpeedControl` that holds its speed.
    """

    duration: eqx.AbstractVar[float]
    adds_to_pedals: ClassVar[bool] = False

    @abc.abstractmethod
    def inputs(self, t: Any) -> Any:
        """The inputs at time t (s, a scalar or an array): a NamedTuple of arrays in the shape of t."""


class AbstractSteering(AbstractManoeuvre):
    """Steering at a constant speed: `steer` (rad at the road wheels) times a shape over time, at a `speed` (m/s)."""

    _: KW_ONLY
    duration: float = eqx.field(static=True)
    speed: jax.Array = parameter("m/s")
    steer: jax.Array = parameter("rad", scale=0.1)

    @abc.abstractmethod
    def form(self, t: jax.Array) -> jax.Array:
        """The steer angle relative to `steer` (-) at times t (s)."""

    def inputs(self, t: Any) -> DriverInputs:
        return constant_speed(self.steer * self.form(as_time(t, self.steer)), self.speed)


def window(t: jax.Array, start: float, end: float, edge: float) -> jax.Array:
    """1 between `start` and `end`, with smooth edges of length `edge` inside this range, and 0 outside."""
    return smooth_step((t - start) / edge) * smooth_step((end - t) / edge)


def constant_speed(steer: jax.Array, speed: jax.Array) -> DriverInputs:
    """The inputs for steering at a constant speed."""
    v_x = jnp.broadcast_to(speed, jnp.shape(steer)).astype(steer.dtype)
    return DriverInputs(steer=steer, v_x=v_x, v_x_rate=jnp.zeros_like(steer))


def check_drive(speed, duration, steer=0.0) -> None:
    """Raise `InputError` unless speed, duration and steer are within their ranges."""
    check_finite("speed", speed)
    check_at_least("speed", speed, 0.0)
    check("steer", steer, lambda v: abs(v) < math.pi / 2, "within a quarter turn", "It is in rad, not degrees.")
    check_positive("duration", duration, "s")
    if eqx.is_array(duration):
        raise InputError("duration is an array: it must be a Python number, because it sets the number of rows.")


def as_time(t: Any, like: jax.Array) -> jax.Array:
    """The time as an array of the dtype of the parameter `like`."""
    return jnp.asarray(t, jnp.result_type(like))
