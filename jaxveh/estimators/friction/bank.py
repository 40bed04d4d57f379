"""The recommended method: one filter of the lateral motion per friction, weighted by their predictions."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.friction.along import AlongEvidence
from jaxveh.estimators.friction.laws import LEAST_FRICTION, PlanarCar
from jaxveh.estimators.friction.motion import Told, next_told, start_told
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.estimators.misfit import Misfit, learn_misfit, no_misfit
from jaxveh.estimators.sequential import implicit_step
from jaxveh.estimators.two_axles import LATERAL

State = record_type(
    "BankState",
    ("v_y", "yaw_rate", "soft_front", "soft_rear", "a_y_offset", "steer_error", "leaning", "steer_offset"),
)
"""Lateral velocity (m/s), yaw rate (rad/s), relative stiffness errors of both axles, the offset of a_y (m/s^2), the error of the
steer that comes and goes (rad), the relative increase of the measured a_y because the body leans, and the offset of the steer
that stays (rad)."""

LEAN_SPREAD = 0.059
"""Standard deviation of the share (-) by which the measured a_y is larger because the body leans."""

STEER_TIME = 3.0
"""s: time constant of an error of the measured steer, most of which is the play of the steering."""


SLOPES, LASTING = 1.0, 0.1
"""m/s^2: by how much a measured acceleration may exceed what the tyres carry, by slopes and offsets; and s: accelerations closer
than this count as one."""

NEAR = 0.18232
"""ln 1.2: a friction is known if it is probably within this range around the median."""


class Bank(NamedTuple):
    """Logarithms of the weights (K,), each filter's mean (K, 8) and covariance (K, 8, 8)."""

    weights: Any
    means: Any
    covariances: Any


class BankMemory(NamedTuple):
    """The last motion, `told`; the filters, `bank`; the memory of the wheel slips, `along` (None for a file without the wheels'
    radius and inertia); for how long the friction has been certain, `certain` (s); and the `misfit` of the predictions."""

    told: Told
    bank: Bank
    along: Any
    certain: Any
    misfit: Misfit


class FrictionBank(AbstractMethod):
    """Friction by a bank of filters, one per friction, whose weights are the probabilities of the frictions.

    Each filter is an extended Kalman filter of a single track whose axle curves are scaled by friction (`SimilarCurve`). Errors
    that could be mistaken for friction are states: the axles' stiffness errors, the offsets of accelerometer and steer. They
    last, so that what the drive has shown of them helps to tell a slippery road from soft axles at once. In each row the
    filters are mixed (interacting multiple models, Blom & Bar-Shalom 1988): friction walks slowly, and sometimes jumps to any
    value. So old evidence is forgotten, a jump is followed as fast as the forces show it, and the standard deviation
    reflects missing excitation: forces in the linear range only show that there is more friction than they use. If the log has
    torques and wheel speeds and the car's file has the wheels' radius and inertia, longitudinal slips also weight the frictions
    (`AlongEvidence`). A friction that could not have carried the measured acceleration is not possible.

    The answer is the median and the standard deviation about it. `known`: for the last `certain_time` (s), the probability that
    the friction is within 20 % of the median was at least `certainty`, and all of these frictions are within those of the bank.
    The estimate is the road's friction over that on which the car's tyre parameters hold, one value for all wheels.

    `frictions` (K,) of the filters and `prior` (K,), their probabilities without information; `jumps` (1/s): rate of jumps to any
    friction; `walk` (1/sqrt(s)): random walk of ln mu; `turn_time`, `force_time` (s): innovations of yaw rate and of a_y closer
    than this count as one; `learn_time` (s): memory of the misfit; `stiffness_spread` (-) of an axle's slope, which changes
    within `stiffness_time` (s); `steer_noise` (rad), play included, and `offset_spread` (rad), the standard deviation of an
    offset that stays; `v_y_noise` (m/s^1.5), `yaw_noise` (rad/s^1.5): model errors; `a_y_noise` (m/s^2) and `force_noise` (-), a
    share of the measured a_y; `yaw_rate_noise` (rad/s).

    The weights are no exact likelihoods: all frictions share one innovation variance, because separate ones would favour low
    friction wherever the noise is overestimated. Where innovations are larger than predicted, on a rough road or with noisy
    sensors, the variances of `yaw_rate_noise` and `a_y_noise` are multiplied by a `misfit` that follows the squared innovations
    over their predicted variances (R. Mehra 1970). It is never below 1: small innovations in gentle driving do not show that the
    model holds near the limit. The standard deviation depends on noises that were chosen on simulated cars and one real log; it
    is too large on some cars and too small on others. A known friction stays known for up to a few seconds after a jump without
    excitation.
    """

    car: PlanarCar
    frictions: jax.Array
    prior: jax.Array
    jumps: jax.Array = positive("1/s", default=0.025)
    walk: jax.Array = positive("1/sqrt(s)", default=0.03)
    turn_time: jax.Array = positive("s", default=0.011)
    force_time: jax.Array = positive("s", default=0.03)
    learn_time: jax.Array = positive("s", default=20.0)
    certainty: jax.Array = parameter("-", scale=0.1, default=0.97)
    certain_time: jax.Array = positive("s", default=0.5)
    stiffness_spread: jax.Array = positive("-", default=0.2)
    stiffness_time: jax.Array = positive("s", default=200.0)
    steer_noise: jax.Array = positive("rad", default=0.0007)
    offset_spread: jax.Array = positive("rad", default=0.004)
    v_y_noise: jax.Array = positive("m/s^1.5", default=0.1)
    yaw_noise: jax.Array = positive("rad/s^1.5", default=0.012)
    a_y_noise: jax.Array = positive("m/s^2", default=0.1)
    force_noise: jax.Array = positive("-", default=0.03)
    yaw_rate_noise: jax.Array = positive("rad/s", default=0.004)
    along: AlongEvidence | None = None

    @property
    def needs(self):
        return LATERAL + (() if self.along is None else self.along.needs) + (Need("a_x", "m/s^2", optional=True),)

    def first(self, t, values):
        bank = Bank(jnp.log(self._prior()), *self._start())
        along = None if self.along is None else self.along.start(t)
        # It begins with the noises below, with which its numbers were chosen.
        misfit = no_misfit(2, t, first=1.0, seconds=0.5)
        return self._said(BankMemory(start_told(t, values, self.car.late), bank, along, jnp.zeros_like(t), misfit), 0.0)

    def next(self, memory, t, values):
        dt = jnp.clip(t - memory.told.t, 0.0, 1.0)
        told = next_told(memory.told, t, values, self.car.late)
        bank = self._mix(memory.bank, dt)
        moved = self._move(bank, told, dt)
        moved, likelihoods, misfit = self._correct(moved, told, values, dt, memory.misfit)
        weights = bank.weights + likelihoods + self._carried(told, values["a_y"], dt)
        along = None
        if self.along is not None:
            along, more = self.along.next(memory.along, t, values, told, self.frictions, jnp.exp(bank.weights))
            weights = weights + more
        means, covariances = self._start()
        keep = lambda new, old: jnp.where(told.moves, new, old)
        bank = Bank(
            keep(weights - jax.nn.logsumexp(weights), bank.weights),
            keep(moved.means, means),
            keep(moved.covariances, covariances),
        )
        misfit = jax.tree.map(keep, misfit, memory.misfit)
        return self._said(BankMemory(told, bank, along, memory.certain, misfit), dt)

    def _prior(self):
        return self.prior / jnp.sum(self.prior)

    def _start(self):
        """The means (K, 8) and covariances (K, 8, 8) before the first row."""
        leaning, soft = self.car.lean, self.stiffness_spread
        spread = State(
            v_y=0.5, yaw_rate=0.1, soft_front=soft, soft_rear=soft, a_y_offset=0.15, steer_error=self.steer_noise,
            leaning=LEAN_SPREAD, steer_offset=self.offset_spread,
        )  # fmt: skip
        mean = State(*[jnp.zeros_like(leaning)] * len(spread))._replace(leaning=leaning)
        every = lambda one: jnp.repeat(one[None], len(self.frictions), axis=0)
        return every(jnp.stack(mean)), every(jnp.diag(jnp.stack(spread) ** 2))

    def _mix(self, bank: Bank, dt) -> Bank:
        """The mixing step, in which friction walks and jumps: each filter starts from those whose friction may have changed to
        its own."""
        count = len(self.frictions)
        spacing = jnp.log(self.frictions[1:] / self.frictions[:-1])
        there = jnp.minimum(0.5 * jnp.square(self.walk / spacing) * dt, 0.3)
        eye = jnp.eye(count, dtype=self.frictions.dtype)
        up, down = jnp.diag(there, 1), jnp.diag(there, -1)
        walks = eye + up + down - jnp.diag(jnp.sum(up + down, axis=1))
        gone = 1.0 - jnp.exp(-self.jumps * dt)
        moves = (1.0 - gone) * walks + gone * self._prior()[None, :]
        joint = moves * jnp.exp(bank.weights)[:, None]
        after = jnp.sum(joint, axis=0)
        share = joint / after[None, :]
        middle = jnp.sum(jnp.exp(bank.weights)[:, None] * bank.means, axis=0)
        off = bank.means - middle
        means = share.T @ off
        squares = bank.covariances + off[:, :, None] * off[:, None, :]
        mixed = jnp.einsum("ij,iab->jab", share, squares) - means[:, :, None] * means[:, None, :]
        return Bank(jnp.log(after), means + middle, mixed)

    def _forces(self, x, friction, told: Told):
        """Lateral forces of both axles (N) in the body's axes; longitudinal forces reduce the available friction."""
        x, car = State(*x), self.car
        steer = told.steer - x.steer_error - x.steer_offset
        slips = car.slip_angles(steer, told.v_x, x.v_y, x.yaw_rate, told.steer_rear)
        loads = car.load_ratios(told.a_x)
        share = jnp.where(told.a_x < 0.0, car.front_brake, car.front_drive)
        forces = []
        for curve, slip, load, soft, part in zip(
            (car.front, car.rear), slips, loads, (x.soft_front, x.soft_rear), (share, 1.0 - share), strict=True
        ):
            limit = jnp.maximum(friction, LEAST_FRICTION) * curve.peak * load
            left = numerics.sqrt(jnp.maximum(1.0 - jnp.square(car.mass * told.a_x * part / limit), 0.04))
            forces.append(curve.force(slip, friction * left, load, 1.0 + soft))
        return forces

    def _rates(self, x, friction, told: Told):
        front, rear = self._forces(x, friction, told)
        car = self.car
        v_y = (front + rear) / car.mass - told.v_x * State(*x).yaw_rate
        turn = (car.front_axle_to_cg * front - car.rear_axle_to_cg * rear) / car.yaw_inertia
        return jnp.stack([v_y, turn])

    def _felt(self, x, friction, told: Told):
        """The lateral acceleration that the leaning accelerometer measures."""
        front, rear = self._forces(x, friction, told)
        x = State(*x)
        return (front + rear) / self.car.mass * (1.0 + x.leaning) + x.a_y_offset

    def _move(self, bank: Bank, told: Told, dt) -> Bank:
        """A linearly implicit trapezoidal step: stable at any speed."""
        soft = self.stiffness_spread * jnp.sqrt(2.0 / self.stiffness_time)
        walks = State(
            v_y=self.v_y_noise, yaw_rate=self.yaw_noise, soft_front=soft, soft_rear=soft, a_y_offset=0.005,
            steer_error=self.steer_noise * jnp.sqrt(2.0 / STEER_TIME), leaning=0.001, steer_offset=1e-5,
        )  # fmt: skip
        noise = jnp.diag(jnp.square(jnp.stack(walks)) * dt)
        dies = jnp.exp(-dt / self.stiffness_time)
        stays = State(*[jnp.ones_like(dt)] * len(walks))
        fades = jnp.stack(stays._replace(soft_front=dies, soft_rear=dies, steer_error=jnp.exp(-dt / STEER_TIME)))

        def one(x, P, friction):
            change, slopes = implicit_step(lambda x: self._rates(x, friction, told), x, dt)
            # Only v_y and yaw rate, the first two, change by the forces.
            step = jnp.diag(fades).at[:2].add(slopes)
            return (fades * x).at[:2].add(change), step @ P @ step.T + noise

        means, covariances = jax.vmap(one)(bank.means, bank.covariances, self.frictions)
        return Bank(bank.weights, means, covariances)

    def _correct(self, bank: Bank, told: Told, values, dt, misfit: Misfit):
        """The bank after this row, the logarithms (K,) of its likelihoods, and the new misfit."""
        a_y = values["a_y"]
        rough = jnp.square(self.a_y_noise) + jnp.square(self.force_noise * jnp.where(jnp.isnan(a_y), 0.0, a_y))
        measured = jnp.stack([values["yaw_rate"], a_y])
        noises = misfit.times * jnp.stack([jnp.square(self.yaw_rate_noise), rough])

        def one(x, P, friction):
            said = []
            observations = (lambda x: State(*x).yaw_rate, lambda x: self._felt(x, friction, told))
            for value, noise, seen in zip(measured, noises, observations, strict=True):
                x, P, error, variance = scalar_update(x, P, value, seen, noise)
                said.append((error, variance))
            return x, P, said

        means, covariances, said = jax.vmap(one)(bank.means, bank.covariances, self.frictions)
        before = jnp.exp(bank.weights)
        likelihoods, ratios = jnp.zeros_like(self.frictions), []
        for (error, variance), time in zip(said, (self.turn_time, self.force_time), strict=True):
            # One variance for all: where noises are a guess, a less certain prediction is not less likely.
            squares = jnp.square(error) / jnp.sum(before * variance)
            likelihoods = likelihoods - 0.5 * (1.0 - jnp.exp(-dt / time)) * squares
            ratios.append(jnp.sum(before * squares))
        ratios = jnp.where(jnp.isnan(measured), jnp.nan, jnp.stack(ratios))
        learnt = learn_misfit(misfit, ratios, dt, self.learn_time)
        return Bank(bank.weights, means, covariances), likelihoods, learnt

    def _carried(self, told: Told, a_y, dt):
        """Logarithms (K,) of how likely each friction carries the accelerations of this row."""
        most = self.frictions * (self.car.front.peak + self.car.rear.peak) / self.car.mass
        a_y = jnp.where(jnp.isnan(a_y), 0.0, a_y) / (1.0 + self.car.lean)
        excess = jnp.maximum(numerics.hypot(told.a_x, a_y) - SLOPES - most, 0.0)
        return -0.5 * jnp.minimum(dt / LASTING, 1.0) * jnp.square(excess / (3.0 * self.a_y_noise))

    def _said(self, memory: BankMemory, dt):
        """The memory with the time for which the friction has been certain, `dt` (s) after the last row, and the answer."""
        weights = jnp.exp(memory.bank.weights)
        logs = jnp.log(self.frictions)
        median = jnp.exp(_quantile(logs, weights, 0.5))
        spacing = (logs[-1] - logs[0]) / (len(logs) - 1)
        within = jnp.square(spacing * self.frictions) / 12.0
        std = numerics.sqrt(jnp.sum(weights * (jnp.square(self.frictions - median) + within)))
        near = jnp.sum(jnp.where(jnp.abs(logs - jnp.log(median)) < NEAR, weights, 0.0))
        # The forces may speak for a friction outside the bank, whose probability gathers at its ends.
        inside = (jnp.abs(jnp.log(median) - 0.5 * (logs[0] + logs[-1])) + NEAR) < 0.5 * (logs[-1] - logs[0])
        certain = memory.told.moves & inside & (near >= self.certainty)
        # Just after a jump, a lag of the tyres' forces can pass for another friction.
        lasted = jnp.where(certain, memory.certain + dt, 0.0)
        said = answer({"friction": median}, {"friction": std}, certain & (lasted >= self.certain_time))
        return memory._replace(certain=lasted), said


def scalar_update(x, P, measured, observation, variance):
    """The Kalman update by one scalar measurement, NaN if missing; with the innovation (0 if missing) and its variance."""
    here = ~jnp.isnan(measured)
    expected, slope = observation(x), jax.grad(observation)(x)
    error = jnp.where(here, measured, expected) - expected
    across = P @ slope
    total = slope @ across + variance
    gain = jnp.where(here, across / total, 0.0)
    P = P - jnp.outer(gain, across)
    return x + gain * error, 0.5 * (P + P.T), error, total


def _quantile(places, weights, share: float):
    """The place at which the cumulated weights reach a share. Each weight is spread evenly to the midpoints to its neighbours."""
    middles = 0.5 * (places[1:] + places[:-1])
    edges = jnp.concatenate([2.0 * places[:1] - middles[:1], middles, 2.0 * places[-1:] - middles[-1:]])
    sums = jnp.concatenate([jnp.zeros_like(weights[:1]), jnp.cumsum(weights)])
    k = jnp.clip(jnp.sum(sums < share) - 1, 0, len(places) - 1)
    part = (share - sums[k]) / jnp.maximum(weights[k], 1e-6)
    return edges[k] + jnp.clip(part, 0.0, 1.0) * (edges[k + 1] - edges[k])
