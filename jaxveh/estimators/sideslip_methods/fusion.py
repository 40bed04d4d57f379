"""Kinematic and dynamic estimates joined: by a switch, by their covariances, by frequency (section 1.3.1), by rules."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import filters
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.estimators.memberships import large
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.sideslip_methods.common import (
    A_X,
    A_Y,
    YAW_RATE,
    Guarded,
    guard,
    joined_needs,
    sideslip_answer,
    size_of,
)
from jaxveh.estimators.sideslip_methods.kinematic import kinematic_kalman
from jaxveh.estimators.sideslip_methods.single_track import single_track_filter
from jaxveh.estimators.sideslip_methods.steady_state import SteadySteer, numbers
from jaxveh.io import CarSpecification

HARD = 4.0
"""m/s^2: of lateral acceleration, the end of a tyre's linear range on dry road."""

SLIPPERY = 2.0
"""m/s^2: a linear single track in a steady turn of this steer would be pushed aside by so much more than the car is: the road is
slippery, or the tyres slide."""

BANKED, BANK_TIME = 0.5, 1.0
"""m/s^2, and s: a_y - v_x r that stays beyond this over this time is gravity on a banked road, and would be integrated."""

PSEUDO_TIME = 0.2
"""s: faster than this the integral counts, slower the dynamic estimate."""


class FusionMemory(NamedTuple):
    """`inner`, the dynamic method's memory; `v_y` (m/s); what it was integrated from (m/s^2), `rate`, and its slow part, `slow`;
    the dynamic estimate of the row before, `model` (m/s); time `t` (s)."""

    inner: Any
    v_y: Any
    rate: Any
    slow: Any
    model: Any
    t: Any


class AbstractFusion(AbstractMethod):
    """A dynamic method `inner`, and the integral of `a_y - v_x r`."""

    inner: AbstractMethod

    @property
    def needs(self):
        return joined_needs(self.inner)

    def first(self, t, values):
        inner, said = self.inner.first(t, values)
        v_y, rate = said.mean.v_y, self._rate(values, jnp.zeros_like(t))
        return FusionMemory(inner, v_y, rate, rate, v_y, t), sideslip_answer(v_y, values["v_x"], said.known.v_y)

    def _rate(self, values, before):
        """What v_y is integrated from, m/s^2; that of the row `before` where a sensor was silent."""
        a_y, yaw_rate = values["a_y"], values["yaw_rate"]
        there = ~(jnp.isnan(a_y) | jnp.isnan(yaw_rate))
        # Nothing is computed of what is missing, whose slopes would not be numbers either.
        a_y, yaw_rate = (jnp.where(there, value, 0.0) for value in (a_y, yaw_rate))
        return jnp.where(there, a_y - values["v_x"] * yaw_rate, before)


class PseudoIntegration(AbstractFusion):
    """D. Piyabongkarn, R. Rajamani et al. (the review's [40, 42, 43]): a first-order filter and its complement.

        dv/dt = a_y - v_x r + (v_dynamic - v) / T

    Exact in each step for what runs evenly through it. An offset o of the accelerometer leaves `o T`. `time` T (s).
    """

    time: jax.Array = positive("s", default=PSEUDO_TIME)

    def __check_init__(self):
        check_parameters(self)

    def next(self, memory, t, values):
        inner, said = self.inner.next(memory.inner, t, values)
        rate, model, kept = self._rate(values, memory.rate), said.mean.v_y, jnp.exp(-(t - memory.t) / self.time)
        towards = 0.5 * (memory.rate + rate) * self.time + 0.5 * (memory.model + model)
        v_y = kept * memory.v_y + (1.0 - kept) * towards
        return FusionMemory(inner, v_y, rate, rate, model, t), sideslip_answer(v_y, values["v_x"], said.known.v_y)


class Switched(AbstractFusion):
    """A. Nishio et al. (the review's [40]): the dynamic estimate, and where its tyres are not to be trusted the integral from
    there.

    They are not where |a_y| is more than `hard`, or where the steer asks a linear car (`steady`) for `slippery` more than is felt
    (m/s^2: little friction). On a road that looks banked, `a_y - v_x r` having been more than `banked` (m/s^2) over `bank_time`
    (s), nothing is integrated. The review names friction and bank as the conditions; the signs and their sizes are ours.
    """

    steady: SteadySteer
    hard: jax.Array = positive("m/s^2", default=HARD)
    slippery: jax.Array = positive("m/s^2", default=SLIPPERY)
    banked: jax.Array = positive("m/s^2", default=BANKED)
    bank_time: jax.Array = positive("s", default=BANK_TIME)

    def __check_init__(self):
        check_parameters(self)

    @property
    def needs(self):
        return joined_needs(self.inner, self.steady)

    def next(self, memory, t, values):
        inner, said = self.inner.next(memory.inner, t, values)
        dt, rate, a_y = t - memory.t, self._rate(values, memory.rate), values["a_y"]
        slow = memory.slow + (1.0 - jnp.exp(-dt / self.bank_time)) * (rate - memory.slow)
        asked = self.steady.asked_acceleration(values["v_x"], values["steer"])
        distrusted = (jnp.abs(a_y) > self.hard) | (jnp.abs(asked) - jnp.abs(a_y) > self.slippery)
        integrates = distrusted & (jnp.abs(slow) <= self.banked)
        integral = memory.v_y + 0.5 * dt * (memory.rate + rate)
        v_y = jnp.where(integrates, integral, said.mean.v_y)
        after = FusionMemory(inner, v_y, rate, slow, said.mean.v_y, t)
        return after, sideslip_answer(v_y, values["v_x"], said.known.v_y)


class Fuzzy(AbstractFusion):
    """S. Shi, H. Lupker et al. (the review's [80]): the integral is pulled to the dynamic estimate by fuzzy rules.

        tyres are worked hard, or sideslip changes quickly, and the road does not look banked  -> integrate
        else                                                                                    -> the dynamic estimate

    Of |a_y| and of |a_y - v_x r|, now and over `bank_time` (s), large is linear between two bounds each (`hard`, `quick`,
    `banked`, m/s^2); "and" is the product. With w the truth of the first rule, v_y is pulled with the time constant
    `time / (1 - w)` (s). The review names the method alone; rules and bounds are ours.
    """

    time: jax.Array = positive("s", default=PSEUDO_TIME)
    bank_time: jax.Array = positive("s", default=BANK_TIME)
    hard: tuple[float, float] = eqx.field(static=True, default=(2.0, 5.0))
    quick: tuple[float, float] = eqx.field(static=True, default=(0.5, 2.0))
    banked: tuple[float, float] = eqx.field(static=True, default=(0.3, 0.7))

    def __check_init__(self):
        check_parameters(self)

    def next(self, memory, t, values):
        inner, said = self.inner.next(memory.inner, t, values)
        dt, rate, model, a_y = t - memory.t, self._rate(values, memory.rate), said.mean.v_y, values["a_y"]
        slow = memory.slow + (1.0 - jnp.exp(-dt / self.bank_time)) * (rate - memory.slow)
        worked = large(jnp.where(jnp.isnan(a_y), 0.0, a_y), *self.hard)
        integrates = (1.0 - (1.0 - worked) * (1.0 - large(rate, *self.quick))) * (1.0 - large(slow, *self.banked))
        integral = memory.v_y + 0.5 * dt * (memory.rate + rate)
        pulled = 1.0 - jnp.exp(-(1.0 - integrates) * dt / self.time)
        v_y = integral + pulled * (model - integral)
        return FusionMemory(inner, v_y, rate, slow, model, t), sideslip_answer(v_y, values["v_x"], said.known.v_y)


class Weighted(AbstractMethod):
    """H. Lee (the review's [41]): the kinematic and the dynamic estimate, weighed by the inverses of the variances that their
    filters state, as if their errors were independent (both read the same sensors)."""

    kinematic: AbstractMethod
    dynamic: AbstractMethod

    @property
    def needs(self):
        return joined_needs(self.kinematic, self.dynamic)

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


SENSORS = (YAW_RATE, A_Y)
EXTENDED = single_track_filter(filters.Extended(), claims=True)


def pseudo_integration(car: CarSpecification) -> Guarded:
    """Pseudo-integration with the extended filter of the single track, for a car's file."""
    inner = PseudoIntegration(EXTENDED(car), PSEUDO_TIME * size_of(car) ** 0.5)
    return guard(car, inner, SENSORS)


def by_switch(car: CarSpecification) -> Guarded:
    """The switch with the extended filter of the single track, for a car's file."""
    steady = SteadySteer(**numbers(car), steer_offset=-(car.steer_offset or 0.0))
    inner = Switched(EXTENDED(car), steady, bank_time=BANK_TIME * size_of(car) ** 0.5)
    return guard(car, inner, SENSORS)


def by_fuzzy_rules(car: CarSpecification) -> Guarded:
    """Fuzzy rules with the extended filter of the single track, for a car's file."""
    scale = size_of(car) ** 0.5
    return guard(car, Fuzzy(EXTENDED(car), PSEUDO_TIME * scale, BANK_TIME * scale), SENSORS)


def weighted_mean(car: CarSpecification) -> Guarded:
    """The weighted mean of the kinematic and the single track's extended filter, for a car's file."""
    return guard(car, Weighted(kinematic_kalman(car, claims=True), EXTENDED(car)), (*SENSORS, A_X), claims=False)
