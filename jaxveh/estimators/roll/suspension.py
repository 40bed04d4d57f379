"""Roll of a body on its springs from the lateral acceleration."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import SILENCE, hold
from jaxveh.estimators.car_file import number_of
from jaxveh.estimators.contract import Need
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

ACCELERATION = Need("a_y", "m/s^2")


class SteadyMemory(NamedTuple):
    """The time (s), the last acceleration (m/s^2), the time since it was measured (s), and the low-passed roll (rad)."""

    t: Any
    a_y: Any
    silence: Any
    roll: Any


class Steady(AbstractMethod):
    """`roll = R a_y / (1 + g R)` (A. Hac et al. 2010, of the suspension): R = `roll_gradient` (rad/(m/s^2)) refers to the
    acceleration in the road's plane; a sensor on the rolling body measures `1 + g R` times this. The roll has a low-pass filter
    of `time` (s), whose derivative is the rate.
    """

    roll_gradient: jax.Array = positive("rad/(m/s^2)")
    time: jax.Array = positive("s", default=0.1)

    @property
    def needs(self):
        return (ACCELERATION,)

    def first(self, t, values):
        zero = jnp.zeros_like(t)
        return self.next(SteadyMemory(t, zero, zero + SILENCE, zero), t, values)

    def next(self, memory, t, values):
        dt = t - memory.t
        a_y = hold(values["a_y"], memory.a_y)
        silence = jnp.where(jnp.isnan(values["a_y"]), memory.silence + dt, 0.0)
        steady = self.roll_gradient / (1.0 + GRAVITY * self.roll_gradient) * a_y
        rate = (steady - memory.roll) / (self.time + dt)
        roll = memory.roll + dt * rate
        said = answer({"roll": roll, "roll_rate": rate, "body_roll": roll}, known=silence < SILENCE)
        return SteadyMemory(t, a_y, silence, roll), said


class SpringsMemory(NamedTuple):
    """The time (s), the last acceleration (m/s^2), the time since it was measured (s), roll (rad) and its rate (rad/s)."""

    t: Any
    a_y: Any
    silence: Any
    roll: Any
    rate: Any


class Springs(AbstractMethod):
    """A body on springs and dampers: `roll'' = w^2 (R (a_y - g roll) - roll) - 2 D w roll'`, stable for steps of any length.

    `roll_gradient` R (rad/(m/s^2)), `roll_frequency` w / 2 pi (Hz), `roll_damping` D (-).
    """

    roll_gradient: jax.Array = positive("rad/(m/s^2)")
    roll_frequency: jax.Array = positive("Hz")
    roll_damping: jax.Array = positive("-")

    @property
    def needs(self):
        return (ACCELERATION,)

    def first(self, t, values):
        zero = jnp.zeros_like(t)
        return self.next(SpringsMemory(t, zero, zero + SILENCE, zero, zero), t, values)

    def next(self, memory, t, values):
        dt = t - memory.t
        a_y = hold(values["a_y"], memory.a_y)
        silence = jnp.where(jnp.isnan(values["a_y"]), memory.silence + dt, 0.0)
        w, half = 2.0 * math.pi * self.roll_frequency, 0.5 * dt
        stiffness = w * w * (1.0 + GRAVITY * self.roll_gradient)
        damping = 2.0 * self.roll_damping * w
        push = w * w * self.roll_gradient * a_y - stiffness * (memory.roll + half * memory.rate)
        change = dt * (push - damping * memory.rate) / (1.0 + half * damping + half * half * stiffness)
        rate = memory.rate + change
        roll = memory.roll + half * (memory.rate + rate)
        said = answer({"roll": roll, "roll_rate": rate, "body_roll": roll}, known=silence < SILENCE)
        return SpringsMemory(t, a_y, silence, roll, rate), said


def steady_of(car: CarSpecification, who: str) -> Steady:
    """Makes `Steady` from a car's file. **Raises** `InputError` for a file without `roll_gradient`."""
    return Steady(number_of(car, "roll_gradient", who, "rad/(m/s^2)"))


def springs_of(car: CarSpecification, who: str) -> Springs:
    """Makes `Springs` from a car's file. **Raises** `InputError` for a file without `roll_gradient`, `roll_frequency` or
    `roll_damping`."""
    keys = (("roll_gradient", "rad/(m/s^2)"), ("roll_frequency", "Hz"), ("roll_damping", "-"))
    return Springs(*[number_of(car, key, who, unit) for key, unit in keys])
