"""Bank in a steady state, faded out in transients."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import CRAWL, LATERAL, SILENCE, STEERING, AbstractMotionMethod, arcsin_of, hold
from jaxveh.estimators.car_file import number_of
from jaxveh.estimators.lateral import Lateral, lateral_of, motion_of
from jaxveh.estimators.method import answer
from jaxveh.io import CarSpecification


class TsengMemory(NamedTuple):
    """The motion; the steering wheel's angle (rad); the low-passed static bank (rad) and trust, `agreement` (-); and for how long
    the signals have been available, `age` (s)."""

    motion: Any
    wheel: Any
    bank: Any
    agreement: Any
    age: Any


class Tseng(AbstractMotionMethod):
    """The bank of H. E. Tseng (Vehicle System Dynamics 36, 2001): `bank = static max(0, 1 - |DFC| - |d static / dt|)`.

    `static = arcsin((f_y - v_x r) / g)`. The dynamics factor DFC is the deviation of acceleration, yaw rate and steer from a
    steady state, in which `l r / v_x = steer - understeer f_y`: that residual over `doubt` (rad). The rate is divided by
    `doubt_rate` (rad/s). All signals have a low-pass filter of `time` (s). `ratio` (-) is the steering ratio.
    """

    car: Lateral
    ratio: jax.Array = positive("-")
    time: jax.Array = positive("s", default=0.5)
    doubt: jax.Array = positive("rad", default=0.02)
    doubt_rate: jax.Array = positive("rad/s", default=0.3)

    @property
    def needs(self):
        return (*LATERAL, STEERING)

    def begin(self, motion, heard):
        return TsengMemory(motion, *[jnp.zeros_like(motion.t)] * 4)

    def follow(self, motion, heard, memory):
        dt, v_x, turn = heard["dt"], heard["v_x"], heard["yaw_rate"]
        wheel = hold(heard["steering_wheel"], memory.wheel)
        f_y = self.car.plane_force(heard["a_y"])
        share = dt / (self.time + dt)
        static = arcsin_of(f_y - v_x * turn)
        slow = memory.bank + share * (static - memory.bank)
        rate = (static - slow) / self.time
        residual = wheel / self.ratio - self.car.steady_steer(v_x, turn, f_y)
        trust = jnp.maximum(0.0, 1.0 - jnp.abs(residual) / self.doubt - jnp.abs(rate) / self.doubt_rate)
        agreement = memory.agreement + share * (trust - memory.agreement)
        there = heard["silence"] < SILENCE
        age = jnp.where(there, memory.age + dt, 0.0)
        known = there & (age > 3.0 * self.time) & (agreement > 0.5) & (jnp.abs(v_x) > CRAWL)
        said = answer({"bank": slow * agreement, "agreement": agreement}, known={"bank": known})
        return TsengMemory(motion, wheel, slow, agreement, age), said


def tseng_of(car: CarSpecification, who: str) -> Tseng:
    """Makes `Tseng` from a car's file."""
    return Tseng(motion_of(car), lateral_of(car, who), ratio=number_of(car, "steering_ratio", who, "-"))


__all__ = ["Tseng", "tseng_of"]
