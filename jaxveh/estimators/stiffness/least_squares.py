"""Stiffness by recursive least squares: from axle forces (equation 15), and from derivatives only (equation 16)."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.method import AbstractMethod, Answer, answer
from jaxveh.estimators.stiffness.single_track import Followed, LinearCar, Signals
from jaxveh.estimators.two_axles import LATERAL


class AbstractLeastSquares(AbstractMethod):
    """A method on signals with the same low-pass filter, `followed`, that starts from the stiffnesses of a `car`. Its memory has
    the signals in a field `signals`."""

    car: LinearCar
    followed: Followed

    @property
    def needs(self):
        return LATERAL

    @abc.abstractmethod
    def begin(self, signals: Signals) -> Any:
        """The memory after the first row."""

    @abc.abstractmethod
    def follow(self, memory: Any, now: Signals, dt: Any) -> Any:
        """The memory after the next row, which counts as at most a second (`dt`, s) later."""

    @abc.abstractmethod
    def say(self, memory: Any) -> Answer:
        """The answer to the row of this memory."""

    def first(self, t, values):
        memory = self.begin(self.followed.start(t, values))
        return memory, self.say(memory)

    def next(self, memory, t, values):
        dt = jnp.clip(t - memory.signals.t, 0.0, 1.0)
        memory = self.follow(memory, self.followed.next(memory.signals, t, values), dt)
        return memory, self.say(memory)


class ForcesMemory(NamedTuple):
    """The signals; mean (4,) and covariance (4, 4) of the least squares."""

    signals: Signals
    mean: Any
    covariance: Any


class AxleForces(AbstractLeastSquares):
    """Least squares on the axles' forces by equation 15 and the difference of their slip angles, with forgetting.

    `delta - l r / v = F_f / C_f - F_r / C_r + offset` holds without the lateral velocity, so that it needs no observer of it (the
    review's general method has one). It is linear in both compliances, an offset, and the delay of the inertial sensors against
    the steer. In slow manoeuvres front and rear forces are nearly proportional, and only the difference of the compliances is
    observable; yaw accelerations distinguish them. Compliances are relative to the file's, so that the unknowns are of similar
    size.

    `memory` (s): time constant of the forgetting; `spread` (-): standard deviation of the relative compliances before the drive;
    `angle_noise` (rad): error of the slip angle difference, with the correlation time `correlation` (s); `known_spread` (-): up
    to this relative standard deviation a stiffness is known.
    """

    memory: jax.Array = positive("s", default=60.0)
    spread: jax.Array = positive("-", default=0.4)
    angle_noise: jax.Array = positive("rad", default=7e-4)
    correlation: jax.Array = positive("s", default=0.3)
    known_spread: jax.Array = positive("-", default=0.1)

    def begin(self, signals):
        return ForcesMemory(signals, jnp.asarray([1.0, 1.0, 0.0, 0.0], self.spread.dtype), self._start())

    def follow(self, memory, now, dt):
        turn = (now.yaw_rate - now.slow_yaw_rate) / self.followed.lag
        front, rear = self.car.axle_forces(now.slow_a_y / (1.0 + self.car.lean), turn)
        phi = jnp.stack([
            front / self.car.front_cornering_stiffness, -rear / self.car.rear_cornering_stiffness, jnp.ones_like(front),
            (now.steer - now.slow_steer) / self.followed.lag,
        ])  # fmt: skip
        difference = (
            now.slow_steer - self.car.steer_offset - self.car.wheelbase * now.slow_yaw_rate / jnp.maximum(now.v_x, 1.0)
        )
        stays = jnp.exp(-dt / self.memory)
        mean = memory.mean
        # Forgetting leads back to the covariance before the drive, so that it does not wind up.
        P = jnp.where(now.moves, stays * memory.covariance + (1.0 - stays) * self._start(), memory.covariance)
        rough = jnp.square(self.angle_noise) * jnp.maximum(self.correlation / jnp.maximum(dt, 1e-3), 1.0)
        across = P @ phi
        gain = jnp.where(now.moves, across / (phi @ across + rough), 0.0)
        P = P - jnp.outer(gain, across)
        return ForcesMemory(now, mean + gain * (difference - phi @ mean), 0.5 * (P + P.T))

    def _start(self):
        return jnp.diag(
            jnp.square(
                jnp.stack(
                    [self.spread, self.spread, jnp.full_like(self.spread, 0.003), jnp.full_like(self.spread, 0.01)]
                )
            )
        )

    def say(self, memory):
        compliance = jnp.clip(memory.mean[:2], 0.2, 5.0)
        std = jnp.sqrt(jnp.diagonal(memory.covariance))[:2]
        car, names = self.car, ("front_cornering_stiffness", "rear_cornering_stiffness")
        mean = {name: getattr(car, name) / compliance[k] for k, name in enumerate(names)}
        spread = {name: mean[name] * std[k] / compliance[k] for k, name in enumerate(names)}
        known = {
            name: memory.signals.moves & (std[k] / compliance[k] < self.known_spread) for k, name in enumerate(names)
        }
        return answer(mean, spread, known)


class DerivativesMemory(NamedTuple):
    """The signals; for front and rear, (2,): accelerations and their filtered values (m/s^2), slip rates and their filtered
    values (rad/s), and the means over the window of the products and of the squared slip rates."""

    signals: Signals
    felt: Any
    slow: Any
    raw_angle: Any
    angle: Any
    product: Any
    square: Any


class Derivatives(AbstractLeastSquares):
    """Stiffness by equation 16 as corrected, at constant speed: the derivative of a force over that of its slip angle.

        C_f = m l_r / l  (d a_f / dt) / (d delta / dt - a_f / v + r),    a_f = a_y + l_f dr/dt

    a_f is the front axle's acceleration (erratum: the print has slip angles there). The formula is exact for `J_z = m l_f l_r` at
    constant speed. The rear stiffness follows in the same way without steer: `C_r = m l_f / l (d a_r / dt) / (r - a_r / v)`,
    a_r = a_y - l_r dr/dt. Single quotients are useless where the denominator is near zero, so that the paper holds the last value
    within epsilon. Here the quotient is that of least squares over `memory` (s), numerator times denominator over denominator
    squared, and denominators below `epsilon` (rad/s) hardly count.

    It gives no standard deviation, because noise in the denominator biases the stiffness low. `known`: the mean square of the
    denominators in the window is above `enough` (-) times the square of epsilon.
    """

    epsilon: jax.Array = positive("rad/s", default=0.01)
    memory: jax.Array = positive("s", default=30.0)
    enough: jax.Array = positive("-", default=0.1)

    def begin(self, signals):
        two = jnp.zeros((2,), signals.t.dtype)
        return DerivativesMemory(signals, two, two, two, two, two, two)

    def follow(self, memory, now, dt):
        lag = self.followed.lag
        turn = (now.yaw_rate - now.slow_yaw_rate) / lag
        a_y = now.slow_a_y / (1.0 + self.car.lean)
        felt = jnp.stack([a_y + self.car.front_axle_to_cg * turn, a_y - self.car.rear_axle_to_cg * turn])
        share = dt / (2.0 * lag + dt)
        # The same low-pass filter once more, so that derivative and value have the same delay.
        slow = memory.slow + share * (felt + memory.felt - 2.0 * memory.slow)
        rate = (felt - slow) / lag
        steer_rate = (now.steer - now.slow_steer) / lag
        raw = jnp.stack([steer_rate + now.slow_yaw_rate, now.slow_yaw_rate]) - felt / jnp.maximum(now.v_x, 1.0)
        angle = memory.angle + share * (raw + memory.raw_angle - 2.0 * memory.angle)
        counts = jnp.where(now.moves, angle**2 / (angle**2 + self.epsilon**2), 0.0)
        fades = jnp.exp(-dt / self.memory)
        gather = lambda old, new: fades * old + (1.0 - fades) * counts * new
        return DerivativesMemory(
            now, felt, slow, raw, angle, gather(memory.product, angle * rate), gather(memory.square, angle**2)
        )

    def say(self, memory):
        car = self.car
        masses = car.mass / car.wheelbase * jnp.stack([car.rear_axle_to_cg, car.front_axle_to_cg])
        file = jnp.stack([car.front_cornering_stiffness, car.rear_cornering_stiffness])
        told = memory.square > self.enough * jnp.square(self.epsilon)
        found = masses * memory.product / numerics.or_one(memory.square, told)
        stiffness = jnp.where(told, jnp.clip(found, 0.2 * file, 5.0 * file), file)
        names = ("front_cornering_stiffness", "rear_cornering_stiffness")
        mean = {name: stiffness[k] for k, name in enumerate(names)}
        known = {name: memory.signals.moves & told[k] for k, name in enumerate(names)}
        return answer(mean, known=known)
