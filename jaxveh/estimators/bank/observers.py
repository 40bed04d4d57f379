"""Bank as the lateral acceleration that the tyres do not explain: disturbance observers."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import CRAWL, LATERAL, SILENCE, AbstractMotionMethod, arcsin_of
from jaxveh.estimators.lateral import Lateral, lateral_of, motion_of
from jaxveh.estimators.method import answer
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

SETTLED = 3.0
"""Number of time constants after which an observer has forgotten its initial state."""


class DisturbanceMemory(NamedTuple):
    """The motion; the low-passed disturbance, `push` (m/s^2), and lateral velocity (m/s); and for how long the signals have been
    available, `age` (s)."""

    motion: Any
    push: Any
    slow_v_y: Any
    age: Any


class DisturbanceObserver(AbstractMotionMethod):
    """A disturbance observer (J. Hahn, R. Rajamani, S. You 2002): the model's lateral acceleration against the measured one.

        g bank = Q (f_y - v_x r - d v_y/dt),    f_y = a_y / (1 + g roll_gradient)

    Q is a low-pass filter of `time` (s), which also gives the derivative without a difference quotient. The paper's sideslip is
    measured; here it is that of a rear axle with its share of the lateral force. The paper's projection, which removes errors of
    the tyres, needs the forces of all four wheels and is left out. An accelerometer offset of 0.1 m/s^2 appears as 0.58 degrees.
    """

    car: Lateral
    time: jax.Array = positive("s", default=0.6)

    @property
    def needs(self):
        return LATERAL

    def begin(self, motion, heard):
        zero = jnp.zeros_like(motion.t)
        return DisturbanceMemory(motion, zero, self._rear(heard), zero)

    def _rear(self, heard):
        return self.car.rear_speed(heard["v_x"], heard["yaw_rate"], self.car.plane_force(heard["a_y"]))

    def follow(self, motion, heard, memory):
        share = heard["dt"] / (self.time + heard["dt"])
        v_y = self._rear(heard)
        slow_v_y = memory.slow_v_y + share * (v_y - memory.slow_v_y)
        plane = self.car.plane_force(heard["a_y"]) - heard["v_x"] * heard["yaw_rate"]
        push = memory.push + share * (plane - memory.push)
        there = heard["silence"] < SILENCE
        age = jnp.where(there, memory.age + heard["dt"], 0.0)
        known = there & (age > SETTLED * self.time)
        bank = arcsin_of(push - (v_y - slow_v_y) / self.time)
        return DisturbanceMemory(motion, push, slow_v_y, age), answer({"bank": bank}, known=known)


class IntegralMemory(NamedTuple):
    """The motion; lateral velocity (m/s); the bank's acceleration, `push` (m/s^2); and for how long the signals have been
    available, `age` (s)."""

    motion: Any
    v_y: Any
    push: Any
    age: Any


class UnknownInput(AbstractMotionMethod):
    """An unknown-input proportional-integral observer (C. Sentouh, Y. Sebsadji, S. Mammar, S. Glaser 2007):

        d v_y = f_y - v_x r - push + 2 w e,    d push = -w^2 e,    e = v_y,rear - v_y,    bank = arcsin(push / g)

    Both poles are at `bandwidth` w (1/s). The paper's observer measures the yaw rate of a car with known tyres; this one follows
    the lateral velocity of a rear axle with its share of the lateral force, which needs no steer.
    """

    car: Lateral
    bandwidth: jax.Array = positive("1/s", default=2.5)

    @property
    def needs(self):
        return LATERAL

    def begin(self, motion, heard):
        return IntegralMemory(motion, *[jnp.zeros_like(motion.t)] * 3)

    def follow(self, motion, heard, memory):
        dt, w, v_x, turn = heard["dt"], self.bandwidth, heard["v_x"], heard["yaw_rate"]
        f_y = self.car.plane_force(heard["a_y"])
        ahead = memory.v_y + dt * (f_y - v_x * turn - memory.push)
        # Exact poles of a step, so that a long step cannot oscillate.
        fade = jnp.exp(-w * dt)
        error = self.car.rear_speed(v_x, turn, f_y) - ahead
        v_y = ahead + (1.0 - fade * fade) * error
        push = memory.push - jnp.where(dt > 0, jnp.square(1.0 - fade) / numerics.or_one(dt, dt > 0), 0.0) * error
        push = jnp.clip(push, -0.5 * GRAVITY, 0.5 * GRAVITY)
        there = heard["silence"] < SILENCE
        age = jnp.where(there, memory.age + dt, 0.0)
        known = there & (age * w > 2.0 * SETTLED) & (jnp.abs(v_x) > CRAWL)
        said = answer({"bank": arcsin_of(push), "v_y": v_y}, known=known)
        return IntegralMemory(motion, v_y, push, age), said


def disturbance_observer(car: CarSpecification, who: str) -> DisturbanceObserver:
    """Makes `DisturbanceObserver` from a car's file."""
    return DisturbanceObserver(motion_of(car), lateral_of(car, who))


def unknown_input_observer(car: CarSpecification, who: str) -> UnknownInput:
    """Makes `UnknownInput` from a car's file."""
    return UnknownInput(motion_of(car), lateral_of(car, who))
