"""Steered rear wheels, for methods that know their angle."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, is_concrete
from jaxveh._core.parameter import parameter, positive
from jaxveh._core.recording import Recording
from jaxveh.estimators.body_motion import steer_heard
from jaxveh.estimators.contract import Need, check_needs
from jaxveh.estimators.delays import SHORTEST_DELAY, unit_delay
from jaxveh.estimators.live import clean_recording
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.prepared import AbstractPreparation, prepare
from jaxveh.estimators.two_axles import LONGEST
from jaxveh.io import CarSpecification
from jaxveh.vehicles import AbstractSteering, FourWheelSteering, kit

CHANNEL = "steer_rear"
"""rad, positive to the left: the mean angle of both rear wheels."""

OF_WHEELS = ("steer_rl", "steer_rr")
"""The angles of the rear wheels, where each has its own."""

WILD, LONGEST_SPIKE = 0.15, 0.1
"""rad and s: an angle that differs by more from the last one is a spike, unless it stays for longer."""


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

    It is that of the channel `steer_rear`, else the mean of `steer_rl` and `steer_rr`, else, where the rear wheels are steered in
    a ratio, that of `steer` less its `offset` (rad), or of `steering_wheel` over the steering's `wheel_ratio` (-). Spikes count
    as missing (`WILD`). Between measurements the angle is held; like the yaw rate it is `late` (s) against the steering sensors.
    After `two_axles.LONGEST` without a measurement how the car turns says nothing: the yaw rate counts as missing, too.
    """

    steering: AbstractSteering
    offset: jax.Array = parameter("rad", scale=0.02, default=0.0)
    late: jax.Array = positive("s", default=0.025)
    wheel_ratio: jax.Array | None = positive("-", default=None)

    @property
    def alternatives(self) -> tuple[tuple[str, ...], ...]:
        """The channels of which one group is enough, the best first."""
        by_ratio = (("steer",), *((("steering_wheel",),) if self.wheel_ratio is not None else ()))
        return ((CHANNEL,), OF_WHEELS, *(by_ratio if isinstance(self.steering, FourWheelSteering) else ()))

    @property
    def more(self):
        return tuple(Need(name, "rad", optional=True) for names in self.alternatives for name in names)

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
        spike = (jnp.abs(measured - memory.raw) > WILD) & (memory.silence + dt < LONGEST_SPIKE)
        there = ~jnp.isnan(measured) & ~spike
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
        heard = lambda name: values.get(name, jnp.full_like(speed, jnp.nan))

        def by_ratio(angle):
            # Without this replacement the derivatives by ratio and speed would be NaN even where the product is not used.
            there = ~jnp.isnan(angle)
            product = self.steering.ratio(speed) * (jnp.where(there, angle, 0.0) - self.offset)
            return jnp.where(there, product, jnp.nan)

        found = [heard(CHANNEL), 0.5 * (heard(OF_WHEELS[0]) + heard(OF_WHEELS[1]))]
        if isinstance(self.steering, FourWheelSteering):
            told = {name: heard(name) for name in ("steer", "steering_wheel")}
            found.append(by_ratio(steer_heard(told, self.wheel_ratio)))
        best = found[-1]
        for value in reversed(found[:-1]):
            best = jnp.where(jnp.isnan(value), best, value)
        return best


def _speed_in(values: dict[str, Any], last: Any) -> Any:
    """The size of the speed in this row (m/s): along the car, the median of the wheels, or over ground; or else the last one."""
    nothing = jnp.full_like(last, jnp.nan)
    wheels = jnp.stack([values.get(name, nothing) for name in kit.wheel_names("wheel_speed")])
    count = jnp.sum(~jnp.isnan(wheels))
    ordered = jnp.sort(jnp.where(jnp.isnan(wheels), jnp.inf, wheels))
    middle = jnp.where(count > 0, ordered[jnp.maximum(count - 1, 0) // 2], jnp.nan)
    for value in (values.get("speed", nothing), middle, values.get("v_x", nothing)):
        there = ~jnp.isnan(value)
        # Without this replacement the derivative would be NaN even where the value is not used.
        last = jnp.where(there, jnp.abs(jnp.where(there, value, 0.0)), last)
    return last


def rear_steer_of(car: CarSpecification) -> RearSteer | None:
    """How the rear wheels of a car's file are steered; None where they are not."""
    if car.steers_front_alone:
        return None
    late = max(unit_delay(car), SHORTEST_DELAY)
    return RearSteer(kit.steering_of(car), car.steer_offset or 0.0, late, car.steering_ratio)


def with_rear_steer(method: AbstractMethod, car: CarSpecification) -> AbstractMethod:
    """A method that reads `rear_angle` in its rows, for a car whose rear wheels may be steered."""
    steered = rear_steer_of(car)
    return method if steered is None else prepare(method, steered)


def check_rear_angle(who: str, tree: Any, recording: Recording) -> None:
    """Raise `InputError` for a log that does not tell the angle of the rear wheels that a `RearSteer` in a tree needs."""
    is_one = lambda node: isinstance(node, RearSteer)
    for one in filter(is_one, jax.tree.leaves(tree, is_leaf=is_one)):
        if not any(all(_told(recording, name) for name in names) for names in one.alternatives):
            others = " or ".join(" and ".join(names) for names in one.alternatives)
            raise InputError(
                f"{who}: {CHANNEL} (rad) is missing from the log, but the car's file says that the rear wheels are steered; "
                f"{others} must have values. Name the columns in a channel map, or leave the steering out of the file if the "
                "rear wheels stay straight."
            )


def _told(recording: Recording, name: str) -> bool:
    """Whether a log has a value of a channel, as far as that can be seen."""
    there = name in recording
    return there and (not is_concrete(recording[name]) or bool(np.isfinite(np.asarray(recording[name])).any()))


def with_rear_angle(who: str, rear_steer: RearSteer | None, recording: Recording) -> Recording:
    """The recording with the angle of the rear wheels in every row, and no yaw rate where it is unknown; without that angle for a
    car that does not steer them. **Raises** as `check_needs` and `check_rear_angle`."""
    if rear_steer is None:
        return recording.without(CHANNEL) if CHANNEL in recording else recording
    check_rear_angle(who, rear_steer, recording)
    present = tuple(need for need in rear_steer.more if need.channel in recording)
    check_needs(who, tuple(need._replace(optional=False) for need in present), recording)
    absent = {name: np.full(len(recording), np.nan) for name in rear_steer.channels if name not in recording}
    return clean_recording(rear_steer, recording.replace(**absent))


def rear_angle(values: dict[str, Any], none: Any = 0.0) -> Any:
    """The angle of the rear wheels in a prepared row (rad); `none`, a zero, in the rows of a car that does not steer them."""
    return values.get(CHANNEL, none)


def rolls_across(values: dict[str, Any], v_x: Any) -> Any:
    """The lateral speed of the rear axle if its wheels roll where they point, m/s."""
    return v_x * numerics.tan(values[CHANNEL]) if CHANNEL in values else 0.0
