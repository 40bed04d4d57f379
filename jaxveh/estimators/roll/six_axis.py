"""Attitude and velocity from a six-axis inertial unit, corrected by the wheels' speed."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import LATERAL, SILENCE, AbstractMotionMethod, hold
from jaxveh.estimators.contract import Need
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.method import answer
from jaxveh.estimators.sequential import Belief, Measurement, belief_of, correct, move, spread_of
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

SIX = (
    *[need._replace(optional=False) if need.channel == "a_x" else need for need in LATERAL],
    Need("roll_rate", "rad/s"),
    Need("pitch_rate", "rad/s"),
)

State = record_type("SixAxisState", ("v_x", "v_y", "roll", "pitch"))


class SixAxisMemory(NamedTuple):
    """The motion; the last roll and pitch rates (rad/s); the time since both were measured, `silence` (s); the belief."""

    motion: Any
    roll_rate: Any
    pitch_rate: Any
    silence: Any
    belief: Belief


class SixAxis(AbstractMotionMethod):
    """The kinematic Kalman filter of W. Klier, A. Reim, D. Stapel (SAE 2008-01-0582), for a car that stays on the road (v_z = 0):

        d v_x = a_x + v_y r + g sin(pitch),                   d v_y = a_y - v_x r - g sin(roll) cos(pitch)
        d roll = p + tan(pitch) (q sin(roll) + r cos(roll)),  d pitch = q cos(roll) - r sin(roll)

    (ISO 8855: pitch positive nose down). The measurements are v_x of the wheels, and zero lateral velocity with the standard
    deviation `slip` (m/s) and the correlation time `slip_time` (s). The sensors' offsets are not estimated, as the review says,
    so that they appear in `roll`.

    `a_noise` (m/s per root second), `gyro_noise` (rad per root second): noise of the integrated sensors; `v_noise` (m/s): noise
    of the wheels' speed.
    """

    a_noise: jax.Array = positive("m/s/sqrt(s)", default=0.05)
    gyro_noise: jax.Array = positive("rad/sqrt(s)", default=0.004)
    v_noise: jax.Array = positive("m/s", default=0.2)
    slip: jax.Array = positive("m/s", default=0.3)
    slip_time: jax.Array = positive("s", default=0.5)

    @property
    def needs(self):
        return SIX

    def begin(self, motion, heard):
        stds = {"v_x": 1.0, "v_y": 0.3, "roll": 0.1, "pitch": 0.1}
        belief = belief_of(State, {"v_x": heard["v_x"]}, stds, motion.t)
        zero = jnp.zeros_like(motion.t)
        return SixAxisMemory(motion, zero, zero, zero + SILENCE, belief)

    def follow(self, motion, heard, memory):
        dt, r = heard["dt"], heard["yaw_rate"]
        p, q = hold(heard["roll_rate"], memory.roll_rate), hold(heard["pitch_rate"], memory.pitch_rate)
        spoke = ~(jnp.isnan(heard["roll_rate"]) | jnp.isnan(heard["pitch_rate"]))
        silence = jnp.where(spoke, 0.0, memory.silence + dt)

        def step(x):
            s, c = numerics.sin(x.roll), numerics.cos(x.roll)
            pitch = jnp.clip(x.pitch, -0.7, 0.7)
            return State(
                x.v_x + dt * (heard["a_x"] + x.v_y * r + GRAVITY * numerics.sin(x.pitch)),
                x.v_y + dt * (heard["a_y"] - x.v_x * r - GRAVITY * s * numerics.cos(x.pitch)),
                x.roll + dt * (p + numerics.tan(pitch) * (q * s + r * c)),
                x.pitch + dt * (q * c - r * s),
            )

        noise = {
            "v_x": self.a_noise, "v_y": self.a_noise, "roll": self.gyro_noise, "pitch": self.gyro_noise
        }  # fmt: skip
        belief = move(memory.belief, step, {name: jnp.square(std) * dt for name, std in noise.items()}, State)
        lasting = jnp.square(self.slip) * 2.0 * self.slip_time / jnp.maximum(dt, 1e-3)
        there = heard["silence"] < SILENCE
        belief = correct(belief, Measurement(lambda x: heard["v_x"] - x.v_x, jnp.square(self.v_noise), there), State)
        belief = correct(belief, Measurement(lambda x: -x.v_y, lasting, there), State)
        x = State(*belief.mean)
        wide = {name: spread_of(belief, {name: 1.0}, State) for name in State._fields}
        tilt = numerics.tan(jnp.clip(x.pitch, -0.7, 0.7)) * r
        said = answer(
            {"roll": x.roll, "roll_rate": p + tilt, "pitch": x.pitch, "v_y": x.v_y},
            known=there & (silence < SILENCE) & (wide["roll"] < 0.03),
        )
        return SixAxisMemory(motion, p, q, silence, belief), said


def six_axis_of(car: CarSpecification) -> SixAxis:
    """Makes `SixAxis` from a car's file."""
    return SixAxis(motion_of(car))
