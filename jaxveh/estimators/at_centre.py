"""Measurements at the centre of gravity, from those of an inertial unit and of a satellite antenna elsewhere in the car."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.delays import satellite_lag
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.prepared import AbstractPreparation, prepare
from jaxveh.io import CarSpecification

YAW_RATE, SPEED = Need("yaw_rate", "rad/s", optional=True), Need("speed", "m/s", optional=True)
"""What moves the channels of `FELT` and `SATELLITES`, beside those that a method reads itself."""

FELT, SATELLITES = ("a_x", "a_y"), ("speed", "course")
"""The channels that are moved: of the inertial unit, and of the antenna."""

LONGEST_SILENCE = 0.25
"""s: after a longer gap of the inertial unit a navigation restarts, and how the car turns is unknown: nothing is moved."""

SLOWEST = 1.0
"""m/s: at a lower speed the course is left as it is; no method uses it there."""


class Turning(NamedTuple):
    """The last row's time `t` (s); the last yaw rate, the low-passed one, `smooth`, and the one of the satellites' time, `late`
    (rad/s); since when there was no yaw rate, `silence` (s); the last speed over ground (m/s), or that along the car."""

    t: Any
    yaw_rate: Any
    smooth: Any
    late: Any
    silence: Any
    speed: Any


def moved_to_centre(a_x: Any, a_y: Any, yaw_rate: Any, yaw_acceleration: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Accelerations (m/s^2) of the centre of gravity in a plane motion, from those at a place `x` ahead and `y` to the left of it
    (m)."""
    turns = jnp.square(yaw_rate)
    return a_x + yaw_acceleration * y + turns * x, a_y - yaw_acceleration * x + turns * y


class AtCentre(AbstractPreparation):
    """Accelerations, course and speed over ground of the centre of gravity, from those of an inertial unit at (`unit_x`,
    `unit_y`) and of an antenna at (`antenna_x`, `antenna_y`) (m, forward and left of it).

    The motion is plane: a rolling or pitching body's part, which depends on the heights, is left. The yaw acceleration is the
    slope of the yaw rate through a low-pass of `smoothing` (s); satellites are late by `lag` (s) against the unit. `over_ground`:
    whether the course is moved, which takes a speed.
    """

    unit_x: jax.Array = parameter("m", default=0.0)
    unit_y: jax.Array = parameter("m", default=0.0)
    antenna_x: jax.Array = parameter("m", default=0.0)
    antenna_y: jax.Array = parameter("m", default=0.0)
    smoothing: jax.Array = positive("s", default=0.03)
    lag: jax.Array = parameter("s", scale=0.1, default=0.125)
    over_ground: bool = eqx.field(static=True, default=False)

    @property
    def more(self):
        return (YAW_RATE, SPEED) if self.over_ground else (YAW_RATE,)

    def first(self, t, values):
        nothing = jnp.zeros_like(t)
        said = jnp.where(jnp.isnan(values["yaw_rate"]), nothing, values["yaw_rate"])
        return self._moved(Turning(t, said, said, said, nothing + 2.0 * LONGEST_SILENCE, nothing), t, values)

    def next(self, memory, t, values):
        return self._moved(memory, t, values)

    def _moved(self, last: Turning, t, values) -> tuple[Turning, dict[str, Any]]:
        """How the car turns after this row, and the row at the centre of gravity."""
        dt, said = t - last.t, values["yaw_rate"]
        yaw_rate = jnp.where(jnp.isnan(said), last.yaw_rate, said)
        silence = jnp.where(jnp.isnan(said), last.silence + dt, 0.0)
        anew = (last.silence > LONGEST_SILENCE) | (dt > LONGEST_SILENCE)

        def low_pass(before, lag):
            # Bilinear: its exact derivative is `(x - low) / lag`, and slow signals are late by `lag` at any step.
            share = dt / (2.0 * lag + dt)
            return jnp.where(anew, yaw_rate, before + share * (yaw_rate + last.yaw_rate - 2.0 * before))

        smooth, late = (
            low_pass(last.smooth, self.smoothing),
            low_pass(last.late, jnp.maximum(self.lag, 0.5 * dt + 1e-6)),
        )
        turning = Turning(t, yaw_rate, smooth, late, silence, self._speed(last.speed, values))
        moved = self._felt(turning, values) | self._over_ground(turning, values)
        return turning, values | {name: value for name, value in moved.items() if name in values}

    def _speed(self, last: Any, values) -> Any:
        """The size of the speed: over ground, or else along the car, or else the last one, m/s."""
        for name in ("v_x", "speed"):
            value = values.get(name, jnp.full_like(last, jnp.nan))
            last = jnp.where(jnp.isnan(value), last, jnp.abs(value))
        return last

    def _felt(self, now: Turning, values) -> dict[str, Any]:
        known, missing = now.silence <= LONGEST_SILENCE, jnp.full_like(now.t, jnp.nan)
        turns = jnp.where(known, now.yaw_rate, 0.0)
        quicker = jnp.where(known, (now.yaw_rate - now.smooth) / self.smoothing, 0.0)
        a_x, a_y = (values.get(name, missing) for name in FELT)
        moved = moved_to_centre(a_x, a_y, turns, quicker, self.unit_x, self.unit_y)
        return dict(zip(FELT, moved, strict=True))

    def _over_ground(self, now: Turning, values) -> dict[str, Any]:
        """Course and speed of the centre of gravity, as far as they are there; those of the antenna are of a wider or narrower
        circle, which a car in reverse (negative `v_x`) runs through the other way."""
        missing = jnp.full_like(now.t, jnp.nan)
        known = (now.silence <= LONGEST_SILENCE) & (now.speed > SLOWEST)
        turns = jnp.where(known, now.late, 0.0) * jnp.where(values.get("v_x", missing) < 0.0, -1.0, 1.0)
        swings = turns * self.antenna_x / jnp.where(known, now.speed, 1.0)
        course, speed = (values.get(name, missing) for name in ("course", "speed"))
        return {"course": course - swings, "speed": speed + turns * self.antenna_y}


def method_at_centre(method: Any, car: CarSpecification) -> Any:
    """The method of a car whose inertial unit and antenna are at the file's `sensor_position` and `antenna_position`; the method
    itself where they are at the centre of gravity, where it knows their places, or reads nothing that depends on them."""
    if not isinstance(method, AbstractMethod):  # `method_of` raises for it
        return method
    reads = {need.channel for need in method.needs}
    unit = car.sensor_position if reads & {*FELT} else None
    antenna = car.antenna_position if reads & {*SATELLITES} else None
    places = [coordinate for place in (unit, antenna) for coordinate in (place or (0.0, 0.0))[:2]]
    if method.knows_places or not any(places):
        return method
    named = dict(zip(("unit_x", "unit_y", "antenna_x", "antenna_y"), places, strict=True))
    return prepare(method, AtCentre(**named, lag=satellite_lag(car), over_ground="course" in reads))
