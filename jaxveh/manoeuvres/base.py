"""The one contract of a manoeuvre: time in, the driver's inputs out."""

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
    """`steer` (rad at the road wheels, positive to the left), `v_x` (m/s) and its rate `v_x_rate` (m/s^2)."""

    steer: Any
    v_x: Any
    v_x_rate: Any


class PedalInputs(NamedTuple):
    """`DriverInputs` of a driver who works the pedals, too.

    `drive_torque` and `brake_torque` (N m, never negative): totals at the wheels.
    """

    steer: Any
    v_x: Any
    v_x_rate: Any
    drive_torque: Any
    brake_torque: Any


class AbstractManoeuvre(eqx.Module):
    """A function of time: what the driver does from t = 0 to `duration` (s). Array leaves are its parameters.

    `adds_to_pedals`: its torques are no pedals of their own, but come on top of those that hold its speed.
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
        """The steer over `steer` (-) at times t (s)."""

    def inputs(self, t: Any) -> DriverInputs:
        return constant_speed(self.steer * self.form(as_time(t, self.steer)), self.speed)


def window(t: jax.Array, start: float, end: float, edge: float) -> jax.Array:
    """1 between `start` and `end` but for smooth edges of length `edge` inside them, 0 outside."""
    return smooth_step((t - start) / edge) * smooth_step((end - t) / edge)


def constant_speed(steer: jax.Array, speed: jax.Array) -> DriverInputs:
    """Steering at a constant speed."""
    v_x = jnp.broadcast_to(speed, jnp.shape(steer)).astype(steer.dtype)
    return DriverInputs(steer=steer, v_x=v_x, v_x_rate=jnp.zeros_like(steer))


def check_drive(speed, duration, steer=0.0) -> None:
    """Raise `InputError` unless speed, duration and steer are those of a drive."""
    check_finite("speed", speed)
    check_at_least("speed", speed, 0.0)
    check("steer", steer, lambda v: abs(v) < math.pi / 2, "within a quarter turn", "It is in rad, not degrees.")
    check_positive("duration", duration, "s")
    if eqx.is_array(duration):
        raise InputError("duration is an array: it must be a Python number, because it sets how many rows there are.")


def as_time(t: Any, like: jax.Array) -> jax.Array:
    """The time as an array of a parameter's type."""
    return jnp.asarray(t, jnp.result_type(like))
