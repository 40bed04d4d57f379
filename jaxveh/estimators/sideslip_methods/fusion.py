"""Fusion of kinematic and dynamic estimates: by a switch, by their covariances, by frequency (section 1.3.1), by rules."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import filters
from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import join_needs
from jaxveh.estimators.memberships import large
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.sideslip_methods.common import (
    A_X,
    Guarded,
    guard,
    sideslip_answer,
    size_of,
)
from jaxveh.estimators.sideslip_methods.kinematic import kinematic_kalman
from jaxveh.estimators.sideslip_methods.single_track import SENSORS, single_track_filter
from jaxveh.estimators.sideslip_methods.steady_state import SteadySteer
from jaxveh.estimators.two_axles import linear_axles_of
from jaxveh.io import CarSpecification

HARD = 4.0
"""m/s^2: lateral acceleration at which a tyre's linear range ends on dry road."""

SLIPPERY = 2.0
"""m/s^2: if a linear single track in a steady turn with this steer had so much more lateral acceleration than the car has, the
road is slippery or the tyres slide."""

BANKED, BANK_TIME = 0.5, 1.0
"""m/s^2, and s: if a_y - v_x r stays beyond this over this time, it is gravity on a banked road and must not be integrated."""

PSEUDO_TIME = 0.2
"""s: on shorter time scales the integral counts, on longer ones the dynamic estimate."""


class FusionMemory(NamedTuple):
    """The dynamic method's memory, `inner`; `v_y` (m/s); its `rate` (m/s^2), which is integrated, and the rate's `slow` part; the
    dynamic estimate of the previous row, `model` (m/s); time `t` (s)."""

    inner: Any
    v_y: Any
    rate: Any
    slow: Any
    model: Any
    t: Any


class AbstractFusion(AbstractMethod):
    """A dynamic method `inner`, and the integral of `a_y - v_x r`."""

    inner: AbstractMethod

    @abc.abstractmethod
    def fuse(self, memory: FusionMemory, dt: Any, rate: Any, model: Any, values: dict[str, Any]) -> tuple[Any, Any]:
        """`v_y` (m/s) of a row, `dt` (s) after the last one, and the slow part of the rate: from the `rate` (m/s^2) and the
        dynamic estimate, `model` (m/s)."""

    @property
    def needs(self):
        return join_needs(self.inner.needs)

    def first(self, t, values):
        inner, said = self.inner.first(t, values)
        v_y, rate = said.mean.v_y, self._rate(values, jnp.zeros_like(t))
        return FusionMemory(inner, v_y, rate, rate, v_y, t), sideslip_answer(v_y, values["v_x"], said.known.v_y)

    def next(self, memory, t, values):
        inner, said = self.inner.next(memory.inner, t, values)
        rate, model = self._rate(values, memory.rate), said.mean.v_y
        v_y, slow = self.fuse(memory, t - memory.t, rate, model, values)
        return FusionMemory(inner, v_y, rate, slow, model, t), sideslip_answer(v_y, values["v_x"], said.known.v_y)

    def _rate(self, values, before):
        """The rate of v_y, m/s^2; that of the previous row, `before`, where a measurement is missing."""
        a_y, yaw_rate = values["a_y"], values["yaw_rate"]
        there = ~(jnp.isnan(a_y) | jnp.isnan(yaw_rate))
        # Missing values are replaced before the computation, because their derivatives would be NaN, too.
        a_y, yaw_rate = (jnp.where(there, value, 0.0) for value in (a_y, yaw_rate))
        return jnp.where(there, a_y - values["v_x"] * yaw_rate, before)


class PseudoIntegration(AbstractFusion):
    """D. Piyabongkarn, R. Rajamani et al. (the review's [40, 42, 43]): a first-order filter and its complement.

        dv/dt = a_y - v_x r + (v_dynamic - v) / T

    The solution is exact for inputs that are constant over a step. An offset o of the accelerometer leaves an error of `o T`.
    `time` T (s).
    """

    time: jax.Array = positive("s", default=PSEUDO_TIME)

    def fuse(self, memory, dt, rate, model, values):
        kept = jnp.exp(-dt / self.time)
        towards = 0.5 * (memory.rate + rate) * self.time + 0.5 * (memory.model + model)
        return kept * memory.v_y + (1.0 - kept) * towards, rate


class Switched(AbstractFusion):
    """A. Nishio et al. (the review's [40]): the dynamic estimate while its tyre model is trusted, and from there on the integral.

    The tyre model is not trusted where |a_y| is more than `hard` (m/s^2), or where the acceleration of a linear car (`steady`)
    for this steer exceeds the measured one by `slippery` (m/s^2; low friction). On a road that seems banked, where `a_y - v_x r`
    was more than `banked` (m/s^2) over `bank_time` (s), nothing is integrated. The review names friction and bank as the
    conditions; how they are detected, and the limits, are ours.
    """

    steady: SteadySteer
    hard: jax.Array = positive("m/s^2", default=HARD)
    slippery: jax.Array = positive("m/s^2", default=SLIPPERY)
    banked: jax.Array = positive("m/s^2", default=BANKED)
    bank_time: jax.Array = positive("s", default=BANK_TIME)

    @property
    def needs(self):
        return join_needs(self.inner.needs, self.steady.needs)

    def fuse(self, memory, dt, rate, model, values):
        a_y = values["a_y"]
        slow = memory.slow + (1.0 - jnp.exp(-dt / self.bank_time)) * (rate - memory.slow)
        asked = self.steady.asked_acceleration(values["v_x"], values["steer"])
        distrusted = (jnp.abs(a_y) > self.hard) | (jnp.abs(asked) - jnp.abs(a_y) > self.slippery)
        integrates = distrusted & (jnp.abs(slow) <= self.banked)
        integral = memory.v_y + 0.5 * dt * (memory.rate + rate)
        return jnp.where(integrates, integral, model), slow


class Fuzzy(AbstractFusion):
    """S. Shi, H. Lupker et al. (the review's [80]): fuzzy rules draw the integral to the dynamic estimate.

        tyre forces are large, or sideslip changes quickly, and the road does not seem banked  -> integrate
        otherwise                                                                               -> the dynamic estimate

    The membership "large" is linear between two bounds: `hard` for |a_y|, `quick` for the present |a_y - v_x r|, and `banked` for
    its mean over `bank_time` (s), all in m/s^2; "and" is the product. With w the truth of the first rule, v_y is drawn to the
    dynamic estimate with the time constant `time / (1 - w)` (s). The review only names the method; rules and bounds are ours.
    """

    time: jax.Array = positive("s", default=PSEUDO_TIME)
    bank_time: jax.Array = positive("s", default=BANK_TIME)
    hard: tuple[float, float] = eqx.field(static=True, default=(2.0, 5.0))
    quick: tuple[float, float] = eqx.field(static=True, default=(0.5, 2.0))
    banked: tuple[float, float] = eqx.field(static=True, default=(0.3, 0.7))

    def fuse(self, memory, dt, rate, model, values):
        a_y = values["a_y"]
        slow = memory.slow + (1.0 - jnp.exp(-dt / self.bank_time)) * (rate - memory.slow)
        worked = large(jnp.where(jnp.isnan(a_y), 0.0, a_y), *self.hard)
        integrates = (1.0 - (1.0 - worked) * (1.0 - large(rate, *self.quick))) * (1.0 - large(slow, *self.banked))
        integral = memory.v_y + 0.5 * dt * (memory.rate + rate)
        pulled = 1.0 - jnp.exp(-(1.0 - integrates) * dt / self.time)
        return integral + pulled * (model - integral), slow


class Weighted(AbstractMethod):
    """H. Lee (the review's [41]): the mean of the kinematic and the dynamic estimate, weighted by the inverse variances of their
    filters, as if their errors were independent (although both use the same sensors)."""

    kinematic: AbstractMethod
    dynamic: AbstractMethod

    @property
    def needs(self):
        return join_needs(self.kinematic.needs, self.dynamic.needs)

    def first(self, t, values):
        one, other = self.kinematic.first(t, values), self.dynamic.first(t, values)
        return self._joined(one, other, values)

    def next(self, memory, t, values):
        one, other = self.kinematic.next(memory[0], t, values), self.dynamic.next(memory[1], t, values)
        return self._joined(one, other, values)

    def _joined(self, one, other, values):
        fast, slow = one[1], other[1]
        weights = fast.std.v_y**-2, slow.std.v_y**-2
        total = weights[0] + weights[1]
        v_y = (weights[0] * fast.mean.v_y + weights[1] * slow.mean.v_y) / total
        said = sideslip_answer(v_y, values["v_x"], slow.known.v_y, total**-0.5)
        return (one[0], other[0]), said._replace(result=jnp.maximum(said.result, slow.result))


EXTENDED = single_track_filter(filters.Extended(), claims=True)


def pseudo_integration(car: CarSpecification) -> Guarded:
    """Makes pseudo-integration with the extended filter of the single track from a car's file."""
    inner = PseudoIntegration(EXTENDED(car), PSEUDO_TIME * size_of(car) ** 0.5)
    return guard(car, inner, SENSORS)


def by_switch(car: CarSpecification) -> Guarded:
    """Makes the switch with the extended filter of the single track from a car's file."""
    steady = SteadySteer(**linear_axles_of(car), steer_offset=-(car.steer_offset or 0.0))
    inner = Switched(EXTENDED(car), steady, bank_time=BANK_TIME * size_of(car) ** 0.5)
    return guard(car, inner, SENSORS)


def by_fuzzy_rules(car: CarSpecification) -> Guarded:
    """Makes the fuzzy rules with the extended filter of the single track from a car's file."""
    scale = size_of(car) ** 0.5
    return guard(car, Fuzzy(EXTENDED(car), PSEUDO_TIME * scale, BANK_TIME * scale), SENSORS)


def weighted_mean(car: CarSpecification) -> Guarded:
    """Makes the weighted mean of the kinematic filter and the single track's extended filter from a car's file."""
    return guard(car, Weighted(kinematic_kalman(car, claims=True), EXTENDED(car)), (*SENSORS, A_X), claims=False)
