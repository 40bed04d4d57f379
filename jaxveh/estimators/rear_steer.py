"""Steered rear wheels, for methods that know their angle."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh._core.recording import Recording
from jaxveh.estimators.contract import Need, check_needs
from jaxveh.estimators.delays import SHORTEST_DELAY, unit_delay
from jaxveh.estimators.live import clean_recording
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.prepared import AbstractPreparation, prepare
from jaxveh.estimators.two_axles import LONGEST
from jaxveh.io import CarSpecification
from jaxveh.vehicles import AbstractSteering, FourWheelSteering, IndependentSteering, kit

CHANNEL = "steer_rear"
"""rad, positive to the left: the mean angle of both rear wheels."""

OF_WHEELS = ("steer_rl", "steer_rr")
"""The angles of the rear wheels, where each has its own."""


class RearSteerMemory(NamedTuple):
    """The last row's time (s); the last angle as measured, `raw`, and with the delay of the inertial unit, `angle` (rad); the
    time since it was measured, `silence` (s); the last speed (m/s)."""

    t: Any
    raw: Any
    angle: Any
    silence: Any
    speed: Any


class RearSteer(AbstractPreparation):
    """The angle of the rear wheels in every row, as `steer_rear` (rad).

    It is that of the channel `steer_rear`, or else follows from those of the wheels or from the channel `steer` and the ratio of
    the `steering`. Between measurements it is held; like the yaw rate it is `late` (s) against the steering sensors. After
    `two_axles.LONGEST` without a measurement how the car turns says nothing: the yaw rate counts as missing. `offset` (rad): of
    the channel `steer` when the car runs straight.
    """

    steering: AbstractSteering
    offset: jax.Array = parameter("rad", scale=0.02, default=0.0)
    late: jax.Array = positive("s", default=0.025)

    @property
    def more(self):
        if isinstance(self.steering, FourWheelSteering):
            return Need("steer", "rad"), Need(CHANNEL, "rad", optional=True)
        if isinstance(self.steering, IndependentSteering):
            return tuple(Need(name, "rad") for name in OF_WHEELS)
        return (Need(CHANNEL, "rad"),)

    @property
    def channels(self):
        return tuple(dict.fromkeys(("v_x", "yaw_rate", *super().channels)))

    @property
    def makes(self):
        return (CHANNEL,)

    def first(self, t, values):
        zero = jnp.zeros_like(t)
        before = RearSteerMemory(t, zero, zero, zero + 2.0 * LONGEST, zero)
        return self.next(before, t, values)

    def next(self, memory, t, values):
        dt = t - memory.t
        speed = _speed_in(values, memory.speed)
        measured = self._measured(values, speed)
        there = ~jnp.isnan(measured)
        raw = jnp.where(there, measured, memory.raw)
        silence = jnp.where(there, 0.0, memory.silence + dt)
        # A Pade delay, the all-pass `2 / (1 + s late / 2) - 1`, with a bilinear low-pass filter, as that of the steer.
        middle = 0.5 * (memory.angle + memory.raw)
        middle = middle + dt / (self.late + dt) * (raw + memory.raw - 2.0 * middle)
        angle = jnp.where(memory.silence > LONGEST, raw, 2.0 * middle - raw)
        heard = values | {CHANNEL: angle}
        if "yaw_rate" in values:
            heard["yaw_rate"] = jnp.where(silence > LONGEST, jnp.nan, values["yaw_rate"])
        return RearSteerMemory(t, raw, angle, silence, speed), heard

    def _measured(self, values, speed) -> Any:
        """The angle (rad) in this row, NaN where it is not measured."""
        if isinstance(self.steering, IndependentSteering):
            return 0.5 * sum(values[name] for name in OF_WHEELS)
        if not isinstance(self.steering, FourWheelSteering):
            return values[CHANNEL]
        by_ratio = self.steering.ratio(speed) * (values["steer"] - self.offset)
        told = values.get(CHANNEL, jnp.full_like(speed, jnp.nan))
        return jnp.where(jnp.isnan(told), by_ratio, told)


def _speed_in(values: dict[str, Any], last: Any) -> Any:
    """The size of the speed in this row (m/s): along the car, that of the wheels or over ground, or else the last one."""
    for name in ("speed", *kit.wheel_names("wheel_speed"), "v_x"):
        value = values.get(name, jnp.nan)
        last = jnp.where(jnp.isnan(value), last, jnp.abs(value))
    return last


def rear_steer_of(car: CarSpecification) -> RearSteer | None:
    """How the rear wheels of a car's file are steered; None where they are not."""
    if car.steers_front_alone:
        return None
    return RearSteer(kit.steering_of(car), car.steer_offset or 0.0, max(unit_delay(car), SHORTEST_DELAY))


def with_rear_steer(method: AbstractMethod, car: CarSpecification) -> AbstractMethod:
    """A method that reads `rear_angle` in its rows, for a car whose rear wheels may be steered."""
    steered = rear_steer_of(car)
    return method if steered is None else prepare(method, steered)


def with_rear_angle(who: str, rear_steer: RearSteer | None, recording: Recording) -> Recording:
    """The recording with the angle of the rear wheels in every row, and no yaw rate where it is unknown; the recording itself for
    a car that does not steer them. **Raises** as `check_needs`."""
    if rear_steer is None:
        return recording
    check_needs(who, rear_steer.more, recording)
    absent = {name: np.full(len(recording), np.nan) for name in rear_steer.channels if name not in recording}
    return clean_recording(rear_steer, recording.replace(**absent))


def rear_angle(values: dict[str, Any]) -> Any:
    """The angle of the rear wheels in a prepared row (rad); 0 in the rows of a car that does not steer them."""
    return values.get(CHANNEL, 0.0)


def rolls_across(values: dict[str, Any], v_x: Any) -> Any:
    """The lateral speed of the rear axle if its wheels roll where they point, m/s."""
    return v_x * numerics.tan(values[CHANNEL]) if CHANNEL in values else 0.0
