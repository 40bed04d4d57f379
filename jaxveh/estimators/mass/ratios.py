"""Mass as the ratio of force and acceleration, by least squares with one unknown."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.body_motion import SILENCE, SLOWEST, AbstractMotionMethod, hold
from jaxveh.estimators.car_file import number_of, numbers_in
from jaxveh.estimators.drive_force import AbstractDriveForce
from jaxveh.estimators.joint import JOINT
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.method import answer
from jaxveh.estimators.pulling import OF_THE_TORQUES, WIDEST_MASS
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

RESIDUAL = 0.05
"""m/s^2: least standard deviation of the residual, force over mass less acceleration."""

START = 2.5
"""s: time until the low-pass filters have forgotten their initial values."""

SLOW = 4.0
"""s: slower changes are attributed to the grade."""


class Pull(AbstractDriveForce):
    """The longitudinal force on a car, and its `pitch_gradient` (rad/(m/s^2))."""

    pitch_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.005, default=0.0)

    def force(self, drive: Any, brake: Any, heard: Any) -> Any:
        """Force along the road, N, without rolling resistance, which is proportional to the mass."""
        return self.drive_force(drive - brake, heard["v_x"], heard["v_x_rate"])


class RatioMemory(NamedTuple):
    """The motion; the last torques (N m); the low-passed `force` (N); slow force (N) and acceleration (m/s^2); the sums of
    squares, of products and of squared residuals; and the time since the first row, `age` (s)."""

    motion: Any
    drive: Any
    brake: Any
    force: Any
    slow_force: Any
    slow_rate: Any
    square: Any
    product: Any
    residual: Any
    age: Any


class AbstractRatio(AbstractMotionMethod):
    """`mass = sum(a F) / sum(a^2)`, with sums over time that start from the file's `mass` (kg) with the relative standard
    deviation `prior_spread` (-), and forget with the time constant `memory` (s). The standard deviation is that of residuals with
    the correlation time `lasting` (s)."""

    pull: Pull
    mass: jax.Array = positive("kg")
    memory: jax.Array = positive("s", default=300.0)
    lasting: jax.Array = positive("s", default=1.2)
    prior_spread: jax.Array = positive("-", default=0.3)

    @abc.abstractmethod
    def pair(self, heard: Any, force: Any, memory: RatioMemory) -> tuple[Any, Any, Any]:
        """Acceleration (m/s^2), force (N), and their weight (0 to 1); the slow parts in the memory are those before this row."""

    @property
    def needs(self):
        return JOINT

    def begin(self, motion, heard):
        zero = jnp.zeros_like(motion.t)
        start = self._start() + zero
        return RatioMemory(motion, zero, zero, zero, zero, zero, start, start * self.mass, zero, zero)

    def follow(self, motion, heard, memory):
        dt = heard["dt"]
        drive, brake = hold(heard["drive_torque"], memory.drive), hold(heard["brake_torque"], memory.brake)
        raw = self.pull.force(drive, brake, heard)
        # The speed's rate has the same low-pass filter.
        force = memory.force + dt / (self.motion.slope_time + dt) * (raw - memory.force)
        rate, push, counts = self.pair(heard, force, memory)
        spoke = ~(jnp.isnan(heard["drive_torque"]) | jnp.isnan(heard["brake_torque"]))
        there = spoke & (heard["pull_silence"] < SILENCE) & (heard["v_x"] > SLOWEST)
        weight = jnp.where(there & (memory.age > START), counts * dt, 0.0)
        keep = jnp.exp(-weight / self.memory)
        mass = memory.product / memory.square
        off = push / mass - rate
        square = keep * memory.square + weight * jnp.square(rate)
        product = keep * memory.product + weight * rate * push
        residual = keep * memory.residual + weight * jnp.square(off)
        share = dt / (SLOW + dt)
        memory = RatioMemory(
            motion, drive, brake, force, memory.slow_force + share * (force - memory.slow_force),
            memory.slow_rate + share * (heard["v_x_rate"] - memory.slow_rate), square, product, residual, memory.age + dt,
        )  # fmt: skip
        start = self._start()
        gathered = jnp.maximum(square - start, 0.0)
        # The mean square of residuals starts at the assumed one.
        mean_square = (residual + jnp.square(RESIDUAL)) / (memory.age + 1.0)
        variance = jnp.maximum(mean_square, jnp.square(RESIDUAL)) * 2.0 * self.lasting / (start + gathered)
        mass = product / square
        std = mass * numerics.sqrt(variance + jnp.square(OF_THE_TORQUES))
        return memory, answer({"mass": mass}, {"mass": std}, known=std < WIDEST_MASS * mass)

    def _start(self):
        """The sum of squares, (m/s^2)^2 s, of the earlier measurement to which the prior is equivalent."""
        return jnp.square(RESIDUAL / self.prior_spread) * 2.0 * self.lasting


def beyond(rate: Any, gate: Any) -> Any:
    """1 for an acceleration above the gate (m/s^2), 0 below, with a smooth transition within a tenth of it."""
    return numerics.smooth_step(0.5 + 5.0 * (jnp.abs(rate) / gate - 1.0))


class Gated(AbstractRatio):
    """The force against the accelerometer where it measures more than `gate` (m/s^2) (P. Karoshi et al. 2018, ref. [8] of paper
    004)."""

    gate: jax.Array = positive("m/s^2", default=0.6)

    def pair(self, heard, force, memory):
        felt = heard["slow_a_x"] / (1.0 + GRAVITY * self.pull.pitch_gradient)
        return felt + GRAVITY * self.pull.rolling_resistance, force, beyond(felt, self.gate)


class KinematicGrade(AbstractRatio):
    """The grade from accelerometer and speed, then `F = m (d v_x/dt + g sin(grade) + g f_r)` (ref. [12] of mass-grade-aukf)."""

    def pair(self, heard, force, memory):
        pitch = self.pull.pitch_gradient
        sine = heard["slope"] - pitch * (heard["slow_a_x"] / (1.0 + GRAVITY * pitch))
        rate = heard["v_x_rate"] + GRAVITY * (sine + self.pull.rolling_resistance)
        return rate, force, beyond(rate, 0.2)


class HighPass(AbstractRatio):
    """Changes of the force faster than `SLOW` against those of the speed's rate, since grades are slower.

    Source: ref. [11] of mass-grade-aukf.
    """

    lasting: jax.Array = positive("s", default=1.0)

    def pair(self, heard, force, memory):
        rate = heard["v_x_rate"] - memory.slow_rate
        return rate, force - memory.slow_force, beyond(rate, 0.1)


def pull_of(car: CarSpecification, who: str) -> Pull:
    """Makes `Pull` from a car's file. **Raises** `InputError` for a file without `wheel_radius`."""
    known = numbers_in(car, "wheel_inertia", "drag", "rolling_resistance", "pitch_gradient")
    return Pull(wheel_radius=number_of(car, "wheel_radius", who, "m"), **known)


def ratio_of(kind: type[AbstractRatio], car: CarSpecification, who: str) -> AbstractRatio:
    """Makes a method of this `kind` from a car's file."""
    return kind(motion_of(car), pull_of(car, who), car.mass)
