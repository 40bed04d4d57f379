"""The contract of a manoeuvre: the driver's inputs as a function of time."""

from __future__ import annotations

import abc
import math
from dataclasses import KW_ONLY
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import check, check_known, check_positive, is_concrete
from jaxveh._core.own_results import named_numbers, number
from jaxveh._core.parameter import check_parameters, parameter
from jaxveh.numerics import smooth_step

FASTEST = 150.0
"""The highest speed of a drive, m/s. Cars on tyres reach 140 m/s; what is faster is another unit or a slip of the pen, and no
tyre law, solver step or length of a drive was made for it."""


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


class AbstractManoeuvre(Checked, eqx.Module):
    """The driver's inputs as a function of time from t = 0 to `duration` (s). Array leaves are its parameters.

    `adds_to_pedals`: its torques are added to the pedals of a `SpeedControl` that holds its speed.
    """

    duration: eqx.AbstractVar[float]
    adds_to_pedals: ClassVar[bool] = False
    _contract = contract(inputs=named_numbers)

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def inputs(self, t: Any) -> Any:
        """The inputs at time t (s, a scalar or an array): a NamedTuple of arrays in the shape of t."""


class AbstractSteering(AbstractManoeuvre):
    """Steering at a constant speed: `steer` (rad at the road wheels) times a shape over time, at a `speed` (m/s)."""

    _: KW_ONLY
    duration: float = eqx.field(static=True)
    speed: jax.Array = parameter("m/s")
    steer: jax.Array = parameter("rad", scale=0.1)
    _contract = contract(form=number)

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


def check_speed(name: str, speed) -> None:
    """Raise `InputError` unless a speed is between 0 and `FASTEST`."""
    check(name, speed, lambda v: (v >= 0) & (v <= FASTEST), f"between 0 and {FASTEST:g} m/s")


def check_steer_deg(name: str, steer_deg) -> None:
    """Raise `InputError` unless a steer in degrees, as programs and studies take it, is within a quarter turn."""
    check(name, steer_deg, lambda v: abs(v) < 90, "between -90 and 90 degrees at the road wheels")


def check_drive(speed, duration, steer=0.0) -> None:
    """Raise `InputError` unless speed, duration and steer are within their ranges."""
    check_speed("speed", speed)
    check("steer", steer, _below_a_quarter_turn, "within a quarter turn", _advice(speed, steer))
    check_positive("duration", duration, "s")
    check_known(duration=duration)


def _below_a_quarter_turn(angle) -> Any:
    return abs(angle) < math.pi / 2


def _advice(speed, steer) -> str:
    """Return what is probably wrong with a steer out of range: the unit, or the order of the arguments."""
    degrees = "It is in rad, not degrees."
    if not is_concrete(speed, steer):
        return degrees
    try:
        speed, steer = float(speed), float(steer)
    except (OverflowError, TypeError, ValueError):
        return degrees
    swapped = _below_a_quarter_turn(speed) and 0 <= steer <= FASTEST
    return "The speed comes first, then the steer; the steer is in rad, not degrees." if swapped else degrees


def as_time(t: Any, like: jax.Array) -> jax.Array:
    """The time as an array of the dtype of the parameter `like`."""
    return jnp.asarray(t, jnp.result_type(like))
