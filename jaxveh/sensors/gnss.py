"""Satellite navigation: speed and course over ground and, optionally, position, with a low rate and a delay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.sensors.device import AbstractInstrument
from jaxveh.sensors.randomness import on_and_off, subkey, white
from jaxveh.sensors.rigid_body import POSES, out_of_axes, rise, velocity
from jaxveh.sensors.sensor_set import Position
from jaxveh.sensors.signal import Signal
from jaxveh.sensors.spans import as_spans, check_spans, inside

_ALONG, _ACROSS, _X, _Y, _OUTAGES, _HEADING, _CLIMB = range(7)
_UNITS = {"speed": "m/s", "course": "rad", "x": "m", "y": "m"}
_MORE_UNITS = {"heading": "rad", "climb_rate": "m/s"}


class GNSS(AbstractInstrument):
    """A receiver that measures `speed` (m/s) and `course` (rad) of its antenna over ground and, with `position`, its
    position `x`, `y` (m).

    - `along`, `across` (m/s): standard deviations of the measured velocity along and across the true one; white. The
      course is the angle of the measured velocity from the world's x axis, positive to the left, within -pi to pi.
    - `lowest` (m/s): below this measured speed the course is undefined, NaN.
    - `position`: a `Signal` with the errors (m) of x and of y, drawn independently, in the world axes of the vehicle's
      outputs. The position of a real receiver wanders slowly: give it a `drift` and a `drift_time`. None: no position.
    - `antenna`: its `Position` from the centre of gravity. `heading`: a `Signal` with the errors (rad) of the channel
      `heading`, the yaw from a second antenna, within -pi to pi, also at standstill. None: there is no second antenna.
    - `climb`: a `Signal` with the errors (m/s) of the vertical speed, `climb_rate`, positive upwards, of a car that
      follows its road; without an output `grade` the road is level. None: it is not measured.
    - `outages`: spans ((start, end), ...) in s without samples (NaN); `outage_rate` (1/s) and `outage_length` (mean, s)
      add random outages.

    **Raises** `InputError` for numbers out of range, reversed spans, or `outage_rate` without `outage_length` or the reverse.
    """

    along: jax.Array | None = positive("m/s", default=None)
    across: jax.Array | None = positive("m/s", default=None)
    lowest: jax.Array | None = positive("m/s", default=None)
    position: Signal | None = None
    antenna: Position = eqx.field(default_factory=Position)
    outage_rate: jax.Array | None = positive("1/s", default=None)
    outage_length: jax.Array | None = positive("s", default=None)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True, converter=as_spans, default=())
    heading: Signal | None = None
    climb: Signal | None = None

    def __check_init__(self):
        check_spans("GNSS.outages", self.outages)
        if (self.outage_rate is None) != (self.outage_length is None):
            raise InputError(
                f"GNSS.outage_rate = {self.outage_rate}, outage_length = {self.outage_length}: give both or neither."
            )
        if not (self.position is None or isinstance(self.position, Signal)):
            raise InputError(f"GNSS.position = {self.position!r}: must be a Signal with the errors in m, or None.")
        if not (self.heading is None or isinstance(self.heading, Signal)):
            raise InputError(f"GNSS.heading = {self.heading!r}: must be a Signal with the errors in rad, or None.")
        if not (self.climb is None or isinstance(self.climb, Signal)):
            raise InputError(f"GNSS.climb = {self.climb!r}: must be a Signal with the errors in m/s, or None.")
        if not isinstance(self.antenna, Position):
            raise InputError(f"GNSS.antenna = {self.antenna!r}: must be a Position.")
        check_parameters(self)

    @property
    def channels(self) -> tuple[str, ...]:
        """Speed and course, and position, heading and vertical speed if the receiver measures them."""
        own = tuple(_UNITS)[: 2 if self.position is None else 4]
        more = {"heading": self.heading, "climb_rate": self.climb}
        return (*own, *(name for name, signal in more.items() if signal is not None))

    @property
    def units(self) -> dict[str, str]:
        """The unit of each channel: m/s, rad or m."""
        return {name: (_UNITS | _MORE_UNITS)[name] for name in self.channels}

    @property
    def needs(self) -> tuple[str, ...]:
        """Velocity and heading, and the position if it is measured."""
        return ("v_x", "v_y", "yaw", "yaw_rate", *(("x", "y") if self.position is not None else ()))

    @property
    def may_use(self) -> tuple[str, ...]:
        """Roll and pitch of the body and their rates, for the antenna; with `climb`, also grade and bank."""
        return POSES if self.climb is None else (*POSES, "grade", "bank")

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """Speed, course and position; NaN in outages."""
        said = self._motion(outputs, key)
        if self.position is not None:
            said |= self._place(outputs, key)
        if self.heading is not None:
            told = self.heading.apply(outputs["yaw"], self.period, subkey(key, _HEADING))
            said["heading"] = numerics.wrap_angle(told)
        if self.climb is not None:
            said["climb_rate"] = self.climb.apply(rise(outputs), self.period, subkey(key, _CLIMB))
        silent = inside(times, self.outages)
        if self.outage_rate is not None:
            assert self.outage_length is not None  # both or neither
            random = on_and_off(
                subkey(key, _OUTAGES), times.shape[0], self.outage_rate, self.outage_length, self.period
            )
            silent = silent | random
        return {name: jnp.where(silent, jnp.nan, value) for name, value in said.items()}

    def _motion(self, outputs, key) -> dict[str, jax.Array]:
        v_x, v_y = velocity(outputs, self.antenna)
        direction = outputs["yaw"] + numerics.arctan2(v_y, v_x)
        noise = lambda std, tag: 0.0 if std is None else std * white(subkey(key, tag), v_x.shape[0], v_x.dtype)
        along = numerics.hypot(v_x, v_y) + noise(self.along, _ALONG)
        across = jnp.zeros_like(along) + noise(self.across, _ACROSS)
        speed = numerics.hypot(along, across)
        c, s = numerics.cos(direction), numerics.sin(direction)
        course = numerics.arctan2(along * s + across * c, along * c - across * s)
        if self.lowest is not None:
            course = jnp.where(speed < self.lowest, jnp.nan, course)
        return {"speed": speed, "course": course}

    def _place(self, outputs, key) -> dict[str, jax.Array]:
        zero = jnp.zeros_like(outputs["x"])
        arm = (self.antenna.x, self.antenna.y, self.antenna.z)
        a_x, a_y, _ = out_of_axes(arm, outputs.get("roll", zero), outputs.get("pitch", zero))
        c, s = numerics.cos(outputs["yaw"]), numerics.sin(outputs["yaw"])
        true = {"x": outputs["x"] + c * a_x - s * a_y, "y": outputs["y"] + s * a_x + c * a_y}
        return {
            name: self.position.apply(true[name], self.period, subkey(key, tag))  # type: ignore[union-attr]
            for name, tag in (("x", _X), ("y", _Y))
        }
