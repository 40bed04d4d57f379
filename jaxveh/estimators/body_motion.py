"""The motion of a car from its control unit's channels, held from row to row, with the angles and rates from which attitude,
grade and mass are estimated."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import AbstractMethod, Answer
from jaxveh.vehicles import GRAVITY, regularised_speed
from jaxveh.vehicles import kit as vehicles

SPEEDS = (
    Need("v_x", "m/s", optional=True),
    *(Need(f"wheel_speed_{at}", "m/s", optional=True) for at in vehicles.CORNERS),
)
"""The sources of the speed: the channel `v_x`, which another estimator may provide, otherwise the wheel speeds."""

LATERAL = (Need("a_y", "m/s^2"), Need("yaw_rate", "rad/s"), Need("a_x", "m/s^2", optional=True), *SPEEDS)
"""Channels of a stability control that describe how the car turns and leans."""

SILENCE = 0.5
"""s: a quantity counts as unknown after its channels have had no measurement for so long."""

STEERING = Need("steering_wheel", "rad")
"""The steering wheel's angle, for a method that requires it."""

SLOWEST = 3.0
"""m/s: the speed at which the road passes is at least this, so that the laws of its bank and grade have a spread at
standstill."""

CRAWL = 2.0
"""m/s: below this speed, angles that are divided by it are regularised."""


def hold(value: Any, last: Any) -> Any:
    """The measurement, or the last one where it is missing."""
    return jnp.where(jnp.isnan(value), last, value)


def speed_heard(values: dict[str, Any], front_share: Any) -> tuple[Any, Any]:
    """Speed in this row (m/s) and whether it was measured: the channel `v_x`, otherwise the wheel speeds that are available.

    The wheels of a driven axle slip under power: each axle is weighted by the other axle's share of the driving torque.
    """
    speeds = jnp.stack([values[need.channel] for need in SPEEDS[1:]])
    there = ~jnp.isnan(speeds)
    front, rear = _axle_weights(jnp.asarray(front_share, speeds.dtype))
    weights = jnp.where(there, jnp.stack([front, front, rear, rear]), 0.0)
    total = jnp.sum(weights)
    wheels = jnp.sum(weights * jnp.where(there, speeds, 0.0)) / numerics.or_one(total, total > 0)
    given = values["v_x"]
    return jnp.where(jnp.isnan(given), wheels, given), ~jnp.isnan(given) | (total > 0)


def steer_heard(values: dict[str, Any], ratio: Any, offset: Any = 0.0) -> Any:
    """Steer of the front wheels in this row (rad), NaN if not measured: the channel `steer` less its `offset` (rad), otherwise
    `steering_wheel` over the steering `ratio` (-; None: that channel is not read)."""
    steer = values["steer"] - offset
    if ratio is None:
        return steer
    wheel = values["steering_wheel"]
    # Without this replacement the derivative of the division would be NaN even where its result is not used.
    turned = jnp.where(jnp.isnan(wheel), 0.0, wheel) / ratio
    return jnp.where(jnp.isnan(steer), jnp.where(jnp.isnan(wheel), jnp.nan, turned), steer)


def driven_share(front_share: Any) -> Any:
    """The share of the driving torque that acts on an axle, averaged over the axles with the weights of the speed: nearly none
    where one axle drives, a half where both drive alike."""
    front, rear = _axle_weights(front_share)
    return (front * front_share + rear * (1.0 - front_share)) / (front + rear)


def _axle_weights(front_share: Any) -> tuple[Any, Any]:
    """Weights of the front and rear axle, never zero, so that the speed of one axle alone can be used."""
    return 1.02 - front_share, 0.02 + front_share


class MotionMemory(NamedTuple):
    """The time (s), the last measured values (SI units), low-passed values, and how long channels have had no measurement (s)."""

    t: Any
    a_x: Any
    a_y: Any
    yaw_rate: Any
    v_x: Any
    slow_a_x: Any
    slow_speed: Any
    late_yaw_rate: Any
    silence: Any
    pull_silence: Any
    speed_silence: Any
    wheel_silence: Any
    started: Any


class BodyMotion(AbstractCleaning):
    """Completes every row: the last measured `a_x`, `a_y`, `yaw_rate`, `v_x` (`speed_spoke`: whether the speed is new,
    `speed_told`: whether it is that of a channel `v_x`), and quantities derived from them.

    - `v_x_rate`, `slow_a_x` (m/s^2) and `slope` (rad): the rate of the speed and `a_x`, both through a low-pass of `slope_time`
    (s), and the body's pitch against the horizon, nose up, `(a_x - v_x_rate) / g` through the same low-pass.
    - `late_yaw_rate` (rad/s): low-passed with half of `delay` (s), that of the satellites against the inertial unit, as time
      constant, for the mean over that delay.
    - `dt` (s): the time since the last row; `silence`, `pull_silence` (s): the time since the last measurement of `a_y` and
      `yaw_rate`, or of `a_x`; or of the speed, if that is longer.

    `front_share`: the front axle's share of the driving torque. `wheels_first`: a channel `v_x` is not used while wheels speak,
    except in reverse, where wheels may count forwards. Other channels are passed on.
    """

    front_share: jax.Array = parameter("-", default=0.5)
    slope_time: jax.Array = positive("s", default=0.7)
    delay: jax.Array = positive("s", default=0.15)
    wheels_first: bool = eqx.field(static=True, default=False)

    @property
    def channels(self):
        return tuple(need.channel for need in LATERAL)

    def first(self, t, values):
        zero = jnp.zeros_like(t)
        silent = zero + SILENCE
        memory = MotionMemory(t, zero, zero, zero, zero, zero, zero, zero, silent, silent, silent, silent, zero)
        return self.next(memory, t, values)

    def next(self, memory, t, values):
        dt = t - memory.t
        wheels = jnp.stack([values[need.channel] for need in SPEEDS[1:]])
        wheel_silence = jnp.where(jnp.all(jnp.isnan(wheels)), memory.wheel_silence + dt, 0.0)
        told = values["v_x"]
        if self.wheels_first:
            told = jnp.where((wheel_silence < SILENCE) & ~(told < 0.0), jnp.nan, told)
        heard, spoke = speed_heard(values | {"v_x": told}, self.front_share)
        v_x = jnp.where(spoke, heard, memory.v_x)
        a_x, a_y, yaw_rate = (hold(values[name], getattr(memory, name)) for name in ("a_x", "a_y", "yaw_rate"))
        pulled = ~jnp.isnan(values["a_x"])
        turned = ~(jnp.isnan(values["a_y"]) | jnp.isnan(values["yaw_rate"]))
        # The low-passes begin at the first measured speed: no speed was lost before it.
        begins = spoke & (memory.started == 0)
        share = dt / (self.slope_time + dt)
        slow_speed = jnp.where(begins, v_x, memory.slow_speed + share * (v_x - memory.slow_speed))
        slow_a_x = jnp.where(begins, a_x, memory.slow_a_x + share * (a_x - memory.slow_a_x))
        late = memory.late_yaw_rate + dt / (0.5 * self.delay + dt) * (yaw_rate - memory.late_yaw_rate)
        v_x_rate = (v_x - slow_speed) / self.slope_time
        memory = MotionMemory(
            t, a_x, a_y, yaw_rate, v_x, slow_a_x, slow_speed, late,
            jnp.where(turned, 0.0, memory.silence + dt), jnp.where(pulled, 0.0, memory.pull_silence + dt),
            jnp.where(spoke, 0.0, memory.speed_silence + dt),
            wheel_silence,
            jnp.where(spoke, 1.0, memory.started),
        )  # fmt: skip
        slope = jnp.clip((slow_a_x - v_x_rate) / GRAVITY, -0.5, 0.5)
        made = {
            "a_x": a_x,
            "a_y": a_y,
            "yaw_rate": yaw_rate,
            "v_x": v_x,
            "speed_spoke": spoke,
            "speed_told": ~jnp.isnan(told),
            "v_x_rate": v_x_rate,
            "slow_a_x": slow_a_x,
            "slope": slope,
            "late_yaw_rate": late,
            "dt": dt,
            "silence": jnp.maximum(memory.silence, memory.speed_silence),
            "pull_silence": jnp.maximum(memory.pull_silence, memory.speed_silence),
        }
        return memory, values | made


class AbstractMotionMethod(AbstractMethod):
    """A method on rows that `motion` completes; its memory has the motion's in a field `motion`."""

    motion: BodyMotion

    @abc.abstractmethod
    def begin(self, motion: MotionMemory, heard: dict[str, Any]) -> Any:
        """The memory before the first row, with the motion after it and the values of the completed row."""

    @abc.abstractmethod
    def follow(self, motion: MotionMemory, heard: dict[str, Any], memory: Any) -> tuple[Any, Answer]:
        """The memory after a row, and the answer to it."""

    def first(self, t, values):
        motion, heard = self.motion.first(t, values)
        return self.follow(motion, heard, self.begin(motion, heard))

    def next(self, memory, t, values):
        motion, heard = self.motion.next(memory.motion, t, values)
        return self.follow(motion, heard, memory)


def away_from_zero(v_x: Any) -> Any:
    """The speed as a divisor (m/s), never near zero."""
    return regularised_speed(v_x, CRAWL)


def passing_speed(v_x: Any) -> Any:
    """The size of a speed, at least `SLOWEST`, m/s: how fast a road's slopes pass below the car."""
    return jnp.maximum(jnp.abs(v_x), SLOWEST)


def arcsin_of(a: Any) -> Any:
    """The angle at which gravity's component equals an acceleration `a` (m/s^2), rad; limited to the angle of 0.9 g."""
    s = jnp.clip(a / GRAVITY, -0.9, 0.9)
    return numerics.arctan2(s, jnp.sqrt(1.0 - s * s))
