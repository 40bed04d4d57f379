"""Grade from a measured acceleration less the rate of a speed."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.body_motion import SILENCE, SLOWEST, AbstractMotionMethod, arcsin_of, hold
from jaxveh.estimators.contract import Need
from jaxveh.estimators.delays import SHORTEST_DELAY, satellite_lag
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.estimators.pulling import ALONG
from jaxveh.estimators.sideslip_methods.common import LONG_AGO
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY


class KinematicMemory(NamedTuple):
    """The motion, and for how long its signals have been available, `age` (s)."""

    motion: Any
    age: Any


class Kinematic(AbstractMotionMethod):
    """`grade = arcsin((a_x / (1 + g P) - d v_x/dt + v_y r) / g)`, P = `pitch_gradient` (rad/(m/s^2)), with the low-pass filter of
    the motion (`slope_time`). For `v_y` only the kinematic part `rear_axle_to_cg r` is used, without slip of the rear axle."""

    rear_axle_to_cg: jax.Array = positive("m")
    pitch_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.005)

    @property
    def needs(self):
        return ALONG

    def begin(self, motion, heard):
        return KinematicMemory(motion, jnp.zeros_like(motion.t))

    def follow(self, motion, heard, memory):
        there = heard["pull_silence"] < SILENCE
        age = jnp.where(there, memory.age + heard["dt"], 0.0)
        felt = heard["slow_a_x"] / (1.0 + GRAVITY * self.pitch_gradient)
        turning = self.rear_axle_to_cg * jnp.square(heard["late_yaw_rate"])
        grade = arcsin_of(felt - heard["v_x_rate"] + turning)
        known = there & (age > 3.0 * self.motion.slope_time)
        return KinematicMemory(motion, age), answer({"grade": grade}, known=known)


class SatelliteMemory(NamedTuple):
    """The motion; the satellites' last speed, its low-passed value (m/s), the time `since` it (s), and whether there was any; the
    measured acceleration with the satellites' delay, `late` (m/s^2), its integral since the last fix (m/s), and its low-passed
    value, `felt` (m/s^2); and for how long all have been available, `age` (s)."""

    motion: Any
    speed: Any
    slow_speed: Any
    since: Any
    started: Any
    late: Any
    gathered: Any
    felt: Any
    age: Any


class Satellite(AbstractMotionMethod):
    """`grade = arcsin((a_x / (1 + g P) - d speed/dt) / g)` with the satellites' speed, which contains no wheel slip (P. Sahlholm,
    K. Johansson 2008). Both have a low-pass filter of `time` (s), the acceleration also one of the satellites' `delay` (s). In
    bends the speed over ground differs slightly from v_x."""

    pitch_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.005)
    time: jax.Array = positive("s", default=1.0)
    delay: jax.Array = positive("s", default=0.15)

    @property
    def needs(self):
        return (*ALONG, Need("speed", "m/s"))

    def begin(self, motion, heard):
        return SatelliteMemory(motion, *[jnp.zeros_like(motion.t)] * 8)

    def follow(self, motion, heard, memory):
        dt, spoke = heard["dt"], ~jnp.isnan(heard["speed"])
        since = memory.since + dt
        speed = hold(heard["speed"], memory.speed)
        share = since / (self.time + since)
        begins = spoke & (memory.started == 0)
        moved = jnp.where(spoke, memory.slow_speed + share * (speed - memory.slow_speed), memory.slow_speed)
        slow = jnp.where(begins, speed, moved)
        started = jnp.where(spoke, 1.0, memory.started)
        late = memory.late + dt / (self.delay + dt) * (heard["a_x"] - memory.late)
        # Both have the same filter at the satellites' rate, with the mean acceleration between two fixes.
        gathered = memory.gathered + dt * late
        mean = gathered / numerics.or_one(since, since > 0)
        felt = jnp.where(spoke, memory.felt + share * (mean - memory.felt), memory.felt)
        gathered = jnp.where(spoke, 0.0, gathered)
        since = jnp.where(spoke, 0.0, since)
        there = (heard["pull_silence"] < SILENCE) & (since < 2.0 * SILENCE) & (started > 0)
        age = jnp.where(there, memory.age + dt, 0.0)
        grade = arcsin_of(felt / (1.0 + GRAVITY * self.pitch_gradient) - (speed - slow) / self.time)
        known = there & (age > 3.0 * self.time)
        memory = SatelliteMemory(motion, speed, slow, since, started, late, gathered, felt, age)
        return memory, answer({"grade": grade}, known=known)


class ClimbMemory(NamedTuple):
    """The time of the last row (s), the time since the satellites' last measurement, `silent` (s), and low-passed vertical and
    horizontal speed (m/s)."""

    t: Any
    silent: Any
    rise: Any
    speed: Any


class Climb(AbstractMethod):
    """`grade = arctan(climb_rate / speed)` from the satellites' vertical and horizontal speed (H. Bae, J. Ryu, J. Gerdes 2001),
    both with a low-pass filter of `time` (s). It has no offset, but a delay. The answer is known above `slowest` (m/s)."""

    time: jax.Array = positive("s", default=0.5)
    slowest: jax.Array = positive("m/s", default=SLOWEST)

    @property
    def needs(self):
        return (Need("speed", "m/s"), Need("climb_rate", "m/s"))

    def first(self, t, values):
        zero = jnp.zeros_like(t)
        return self.next(ClimbMemory(t, zero + LONG_AGO, zero, zero), t, values)

    def next(self, memory, t, values):
        spoke = ~(jnp.isnan(values["speed"]) | jnp.isnan(values["climb_rate"]))
        since = memory.silent + (t - memory.t)
        share = jnp.where(spoke, since / (self.time + since), 0.0)
        low = lambda last, value: last + share * (jnp.where(spoke, value, last) - last)
        rise, speed = low(memory.rise, values["climb_rate"]), low(memory.speed, values["speed"])
        silent = jnp.where(spoke, 0.0, since)
        known = (silent < 2.0 * SILENCE) & (speed > self.slowest)
        grade = jnp.where(speed > 0.0, numerics.arctan(rise / numerics.or_one(speed, speed > 0.0)), 0.0)
        return ClimbMemory(t, silent, rise, speed), answer({"grade": grade}, known=known)


def kinematic_of(car: CarSpecification) -> Kinematic:
    """Makes `Kinematic` from a car's file; without a `pitch_gradient` the body does not pitch."""
    return Kinematic(motion_of(car), car.rear_axle_to_cg, car.pitch_gradient or 0.0)


def satellite_of(car: CarSpecification) -> Satellite:
    """Makes `Satellite` from a car's file; without a `pitch_gradient` the body does not pitch."""
    return Satellite(motion_of(car), car.pitch_gradient or 0.0, delay=max(satellite_lag(car), SHORTEST_DELAY))
