"""Stiffnesses as random-walk states of a single track whose axles bend, with offsets and satellite course."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.delays import SHORTEST_DELAY, satellite_lag
from jaxveh.estimators.method import AbstractSmoothable, answer
from jaxveh.estimators.misfit import Misfit, learn_misfit, no_misfit
from jaxveh.estimators.sequential import Belief, implicit_step, innovation, update
from jaxveh.estimators.stiffness.single_track import Followed, LinearCar, Signals, linear_car, signals_of
from jaxveh.estimators.two_axles import LATERAL, LOWEST
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

STATES = 11
"""Number of states: v_y (m/s), yaw rate (rad/s), ln of both stiffnesses over the file's, offsets of steer (rad), a_y (m/s^2) and
yaw rate (rad/s), relative increase of the measured a_y because the body leans, yaw (rad), error of the delay between inertial
sensors and steer (s), and ln of the axles' grip (their largest lateral force over load)."""

SATELLITE = (Need("course", "rad", optional=True),)

MEASURED = ("yaw_rate", "a_y", "course")
"""The channels that the filter measures; speed and steer are its inputs."""


LONGEST_WAIT = 1.0
"""s: the longest time between two fixes of a satellite receiver that counts as available."""

BLIND, GUIDED, FORGOTTEN = 0.25, 20.0, 300.0
"""Without a course, noises of steer and a_y and the bend of tyres' curves are taken for soft tyres: by 0.15 to 0.45 on simulated
cars, whatever the filter's own standard deviation. This standard deviation of ln C is added, and fades within `GUIDED` s of
driving with a course; in as much as `FORGOTTEN` s without one it returns."""


TRAIL = 0.011
"""The pneumatic trail over the wheelbase: some 9 % of the wheel's radius (QDZ1 of public property files: 6 to 14 %)."""

OF_THE_MASS = 0.04
"""Relative standard deviation of a stiffness by an error of the mass in the car's file."""

OF_THE_LENGTHS = 0.03
"""Relative standard deviation of a stiffness by errors of lengths, inertia and trail, which no drive shows."""


class WalkMemory(NamedTuple):
    """The signals; the belief of the states; the low-passed rate of the course, a_y / v (rad/s); the time since the last course,
    and for how long the car has lately driven with one, `guided` (s); the `misfit` of yaw rate, a_y and course."""

    signals: Signals
    belief: Belief
    turning: Any
    course_age: Any
    guided: Any
    misfit: Misfit


class WalkingStiffness(AbstractSmoothable):
    """An extended Kalman filter of [v_y, yaw rate, ln C_f, ln C_r, offsets of steer, a_y and yaw rate, lean, yaw, delay,
    ln grip].

    The model is the single track with the file's mass, inertia and lengths. Its axles bend: driven with a_y of 3 m/s^2 RMS,
    linear ones would be found a tenth too soft, on a slippery road a third. Their `grip` (-: largest lateral force over load) is
    a state, since the road's friction is unknown. Lateral forces act behind the wheels' centres by a pneumatic `trail` (-, over
    the wheelbase). The measurements are yaw rate, lateral acceleration and, if the log has it, the satellites'
    `course = yaw + v_y / v` (references [46, 47]), the only one that depends directly on the sideslip. It is delayed by
    `course_delay` (s) against the inertial sensors; the filter adds its change since, the integral of a_y / v. Errors that
    could be mistaken for stiffness are states of their own: offsets, and the body's lean, which increases the measured
    acceleration. Beyond a share of the grip (`linear`, -) measurements count less and less. By how much they are noisier than
    below is learned, their `Misfit`.

    Without a course a stiffness is not known (`BLIND`), and a noisy one counts for less.

    `spread`, `grip_spread` (-): standard deviations of ln C and ln grip before the drive, `walk`, `grip_walk` (1/sqrt(s)): their
    random walks; `v_y_noise` (m/s^1.5), `yaw_noise` (rad/s^1.5); `a_y_noise` (m/s^2), `yaw_rate_noise` (rad/s), `course_noise`
    (m/s, lateral); `steer_noise` (rad/sqrt(s)): random walk of the steer's offset, play included; `known_spread` (-): up to this
    standard deviation of ln C a stiffness is known.
    """

    car: LinearCar
    followed: Followed
    spread: jax.Array = positive("-", default=0.35)
    walk: jax.Array = positive("1/sqrt(s)", default=0.004)
    v_y_noise: jax.Array = positive("m/s^1.5", default=0.13)
    yaw_noise: jax.Array = positive("rad/s^1.5", default=0.05)
    a_y_noise: jax.Array = positive("m/s^2", default=0.2)
    yaw_rate_noise: jax.Array = positive("rad/s", default=0.004)
    steer_noise: jax.Array = positive("rad/sqrt(s)", default=2e-4)
    course_noise: jax.Array = positive("m/s", default=0.07)
    course_delay: jax.Array = positive("s", default=0.125)
    linear: jax.Array = positive("-", default=0.37)
    grip: jax.Array = positive("-", default=1.1)
    trail: jax.Array = parameter("-", scale=0.01, default=TRAIL)
    grip_spread: jax.Array = positive("-", default=0.5)
    grip_walk: jax.Array = positive("1/sqrt(s)", default=0.1)
    known_spread: jax.Array = positive("-", default=0.075)

    @property
    def needs(self):
        return LATERAL + SATELLITE

    def first(self, t, values):
        signals = self.followed.start(t, values)
        mean = jnp.zeros((STATES,), self.spread.dtype).at[7].set(self.car.lean).at[10].set(jnp.log(self.grip))
        zero = jnp.zeros_like(t)
        memory = WalkMemory(signals, Belief(mean, self._start()), zero, zero + 1e3, zero, no_misfit(3, t))
        return memory, self.say(memory)

    def next(self, memory, t, values):
        dt, now = self._hear(memory, t, values)
        v_x = jnp.maximum(now.v_x, LOWEST)
        share = 1.0 - jnp.exp(-2.0 * dt / self.course_delay)
        turning = memory.turning + share * (now.a_y / (1.0 + self.car.lean) / v_x - memory.turning)
        start = belief = self.ahead(memory, t, values)
        rough = 1.0 + jnp.square(jnp.square(now.a_y / (self.linear * GRAVITY * _grip(belief.mean))))
        felt = lambda x: self._forces(x, now)[2] * (1.0 + x[7]) + x[5]
        seen = lambda x: x[8] + x[0] / v_x
        expected = (lambda x: x[1] + x[6]), felt, seen
        noises = self.yaw_rate_noise, self.a_y_noise, self.course_noise / v_x
        squares = []
        for name, expect, noise, times in zip(MEASURED, expected, noises, memory.misfit.times, strict=True):
            value = values[name]
            if name == "course":
                ahead = seen(belief.mean)
                value = ahead + numerics.wrap_angle(value + self.course_delay * turning - ahead)
            found = innovation(belief, expect, value, times * rough * jnp.square(noise))
            squares.append(jnp.where(jnp.isnan(value), jnp.nan, jnp.square(found.residual) / found.variance))
            belief = update(belief, found)
        misfit = learn_misfit(memory.misfit, jnp.stack(squares), dt)
        age = jnp.where(jnp.isnan(values["course"]), memory.course_age + dt, 0.0)
        guided = jnp.where(
            age < LONGEST_WAIT, memory.guided + dt / misfit.times[2], memory.guided * jnp.exp(-dt / FORGOTTEN)
        )
        belief, guided, misfit = jax.tree.map(
            lambda a, b: jnp.where(now.moves, a, b), (belief, guided, misfit), (start, memory.guided, memory.misfit)
        )
        after = WalkMemory(now, belief, turning, age, guided, misfit)
        return after, self.say(after)

    def ahead(self, memory, t, values):
        dt, now = self._hear(memory, t, values)
        mean, covariance = memory.belief
        moved, stood = self._move(memory.belief, now, dt), Belief(mean.at[:2].set(0.0), self._standing(covariance))
        return jax.tree.map(lambda a, b: jnp.where(now.moves, a, b), moved, stood)

    def _hear(self, memory, t, values):
        """The time since the last row (s), at most one second, and the signals of this row."""
        return jnp.clip(t - memory.signals.t, 0.0, 1.0), self.followed.next(memory.signals, t, values)

    def _start(self):
        spreads = (0.3, 0.1, self.spread, self.spread, 0.002, 0.15, 0.005, 0.06, 3.0, 0.01, self.grip_spread)
        return jnp.diag(jnp.square(jnp.stack([numerics.as_wide_as(spread, self.spread) for spread in spreads])))

    def _standing(self, P):
        """The covariance at standstill, where only that of the constants is kept."""
        start = self._start()
        keep = (jnp.arange(STATES) >= 2) & (jnp.arange(STATES) != 8)
        return jnp.where(keep[:, None] & keep[None, :], P, start)

    def _forces(self, x, now: Signals):
        """The lateral forces of front and rear axle, N, and their acceleration, m/s^2."""
        car = self.car
        v_x = jnp.maximum(now.v_x, LOWEST)
        front = car.front_cornering_stiffness * jnp.exp(jnp.clip(x[2], -1.6, 1.6))
        rear = car.rear_cornering_stiffness * jnp.exp(jnp.clip(x[3], -1.6, 1.6))
        steer = now.steer - x[9] * (now.steer - now.slow_steer) / self.followed.lag
        front = front * (steer - car.steer_offset - x[4] - (x[0] + car.front_axle_to_cg * x[1]) / v_x)
        rear = rear * (now.steer_rear - (x[0] - car.rear_axle_to_cg * x[1]) / v_x)
        length = car.front_axle_to_cg + car.rear_axle_to_cg
        grips = (_grip(x) * car.mass * GRAVITY / length * arm for arm in (car.rear_axle_to_cg, car.front_axle_to_cg))
        front, rear = (_bent(force, grip) for force, grip in zip((front, rear), grips, strict=True))
        return front, rear, (front + rear) / car.mass

    def _move(self, belief: Belief, now: Signals, dt) -> Belief:
        car, x = self.car, belief.mean

        def rates(x):
            front, rear, push = self._forces(x, now)
            trail = self.trail * (car.front_axle_to_cg + car.rear_axle_to_cg)
            turn = ((car.front_axle_to_cg - trail) * front - (car.rear_axle_to_cg + trail) * rear) / car.yaw_inertia
            return jnp.stack([push - now.v_x * x[1], turn])

        change, slopes = implicit_step(rates, x, dt)
        step = jnp.eye(STATES, dtype=x.dtype).at[:2].add(slopes).at[8, 1].set(dt)
        walks = (
            self.v_y_noise, self.yaw_noise, self.walk, self.walk, self.steer_noise, 0.002, 1e-5, 1e-4, 2e-3, 1e-5,
            self.grip_walk,
        )  # fmt: skip
        moved = x.at[:2].add(change).at[8].add(dt * x[1])
        noise = jnp.diag(jnp.stack([jnp.square(walk) * dt for walk in walks]))
        return Belief(moved, step @ belief.covariance @ step.T + noise)

    def say(self, memory):
        return self.answer_for(memory, 1.0, OF_THE_MASS)

    def answer_for(self, memory: WalkMemory, heavier: Any, of_the_mass: Any):
        """The answer for a car whose mass is `heavier` (-) times that of the file, with this relative standard deviation."""
        now, (x, P) = memory.signals, memory.belief
        blind = BLIND * jnp.exp(-memory.guided / GUIDED)
        std = jnp.sqrt(jnp.diagonal(P)[2:4] + jnp.square(blind) + jnp.square(of_the_mass) + OF_THE_LENGTHS**2)
        file = (self.car.front_cornering_stiffness, self.car.rear_cornering_stiffness)
        names = ("front_cornering_stiffness", "rear_cornering_stiffness")
        mean = {name: heavier * file[k] * jnp.exp(jnp.clip(x[2 + k], -1.6, 1.6)) for k, name in enumerate(names)}
        known = {name: now.moves & (std[k] < self.known_spread) for k, name in enumerate(names)}
        return answer(mean, {name: mean[name] * std[k] for k, name in enumerate(names)}, known)


def walking_stiffness(car: CarSpecification) -> WalkingStiffness:
    """The method for a car's file."""
    return WalkingStiffness(linear_car(car), signals_of(car), course_delay=max(satellite_lag(car), SHORTEST_DELAY))


def _grip(x: Any) -> Any:
    """The grip of both axles; between ice and racing tyres with downforce, so that the exponential stays finite."""
    return jnp.exp(jnp.clip(x[10], -3.0, 1.0))


def _bent(force: Any, grip: Any) -> Any:
    """The force of an axle given that of its slope at zero slip, and its `grip`: the curve of `RearAxle` with a shape of 2."""
    return force / numerics.sqrt(1.0 + jnp.square(force / grip))
