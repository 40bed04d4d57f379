"""Roll from a gyroscope about the car's x axis."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import LATERAL, SILENCE, AbstractMotionMethod, arcsin_of, hold
from jaxveh.estimators.contract import Need
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.method import answer
from jaxveh.io import CarSpecification

ROLL_RATE = Need("roll_rate", "rad/s")


class GyroMemory(NamedTuple):
    """The motion; the last roll rate (rad/s) and the time since it was measured (s); roll (rad); the gyroscope's offset (rad/s);
    for how long all signals have been available, `age` (s)."""

    motion: Any
    rate: Any
    silence: Any
    roll: Any
    offset: Any
    age: Any


class Gyro(AbstractMotionMethod):
    """A complementary filter (A. Hac, D. Nichols, D. Sygnarowicz 2010: roll first, then the lateral speed):

        d roll = roll_rate + r slope - offset + e / time,   d offset = -e / (4 time^2),   e = arcsin((a_y - v_x r) / g) - roll

    Fast roll comes from the gyroscope, slow roll from the accelerometer, whose reference is right except for `d v_y/dt`, which
    has zero mean. `slope`: the car's pitch, by which the gyroscope measures a part of the yaw rate r. `time` (s): time constant
    between slow and fast.
    """

    time: jax.Array = positive("s", default=4.0)

    @property
    def needs(self):
        return (*LATERAL, ROLL_RATE)

    def begin(self, motion, heard):
        zero = jnp.zeros_like(motion.t)
        return GyroMemory(motion, zero, zero + SILENCE, zero, zero, zero)

    def follow(self, motion, heard, memory):
        dt = heard["dt"]
        rate = hold(heard["roll_rate"], memory.rate)
        silence = jnp.where(jnp.isnan(heard["roll_rate"]), memory.silence + dt, 0.0)
        there = (silence < SILENCE) & (heard["silence"] < SILENCE)
        turning = rate + heard["yaw_rate"] * heard["slope"]
        ahead = memory.roll + dt * (turning - memory.offset)
        error = arcsin_of(heard["a_y"] - heard["v_x"] * heard["yaw_rate"]) - ahead
        gain = dt / (self.time + dt)
        # At first only the accelerometer counts, because the angle is unknown.
        gain = jnp.maximum(gain, dt / (memory.age + dt + 1e-6))
        error = jnp.where(there, error, 0.0)
        roll = ahead + gain * error
        offset = memory.offset - 0.25 * dt / (jnp.square(self.time) + jnp.square(dt)) * error
        age = jnp.where(there, memory.age + dt, 0.0)
        said = answer(
            {"roll": roll, "roll_rate": turning - offset, "roll_rate_bias": offset}, known=there & (age > self.time)
        )
        return GyroMemory(motion, rate, silence, roll, offset, age), said


def gyro_of(car: CarSpecification) -> Gyro:
    """Makes `Gyro` from a car's file."""
    return Gyro(motion_of(car))
