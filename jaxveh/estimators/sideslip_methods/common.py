"""Shared parts of the sideslip methods: the channels, when an answer counts as known, and the values of the car's file that they
need."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import AbstractMethod, Answer, answer
from jaxveh.estimators.rear_axle import USUAL_WHEELBASE
from jaxveh.io import CarSpecification

V_X = Need("v_x", "m/s", throughout=True)
STEER = Need("steer", "rad", throughout=True)
YAW_RATE = Need("yaw_rate", "rad/s")
A_X, A_Y, A_Z = (Need(f"a_{axis}", "m/s^2") for axis in "xyz")
ROLL_RATE, PITCH_RATE = Need("roll_rate", "rad/s"), Need("pitch_rate", "rad/s")

SLOWEST = 3.0
"""m/s, for a car of the usual wheelbase: sideslip is not known when the car goes slower than this, or backwards, for it is then
the quotient of two small numbers."""

LONGEST_SILENCE = 0.3
"""s: if a channel that a method needs has had no measurement for longer than this, the answer is only a guess."""

WIDEST = 0.05
"""rad: an answer whose own standard deviation of sideslip is larger is not known. A stability control acts at about 0.05 rad."""

FARTHEST = 2.0
"""Largest ratio of lateral to longitudinal speed, 63 degrees of sideslip. Beyond it the car has spun, or the method has
diverged."""

LONG_AGO = 1e3
"""s: the age of a channel that was never measured."""


class StraightSteer(AbstractCleaning):
    """Takes the `offset` (rad) of the channel `steer` out, for cars that have none of their own."""

    offset: jax.Array = parameter("rad", scale=0.02)

    @property
    def channels(self):
        return ("steer",)

    def first(self, t, values):
        return None, values | {"steer": values["steer"] - self.offset}

    def next(self, memory, t, values):
        return self.first(t, values)


def straight_steer(car: CarSpecification) -> StraightSteer:
    """`StraightSteer` with the offset of a car's file."""
    return StraightSteer(car.steer_offset or 0.0)


class Watched(NamedTuple):
    """The memory of `Guarded`: the method's memory, `inner`; time `t` (s); last values by name, `held`, and their `ages` (s)."""

    inner: Any
    t: Any
    held: Any
    ages: Any


class Guarded(AbstractMethod):
    """A sideslip method that marks when its answers are known.

    An answer is known where the car goes forward faster than `slowest` (m/s), each channel in `hears` was measured within the
    last `LONGEST_SILENCE`, the car has not spun (`FARTHEST`), and the standard deviation of sideslip, where `inner` gives one, is
    at most `WIDEST`. `holds`: channels whose last value is passed to `inner` in rows without a measurement (0 before the first).
    `anew`: `inner` starts again at the first row after a gap longer than `LONGEST_SILENCE`, since an integral over the gap is
    worthless. `claims` False: no standard deviation is passed on.
    """

    inner: AbstractMethod
    slowest: jax.Array = positive("m/s")
    hears: tuple[str, ...] = eqx.field(static=True, default=())
    holds: tuple[str, ...] = eqx.field(static=True, default=())
    anew: bool = eqx.field(static=True, default=False)
    claims: bool = eqx.field(static=True, default=True)

    @property
    def needs(self):
        return self.inner.needs

    @property
    def knows_places(self):
        return self.inner.knows_places

    def first(self, t, values):
        none = jnp.zeros_like(t)
        there = {name: ~jnp.isnan(values[name]) for name in {*self.hears, *self.holds}}
        held = record("Held", {n: jnp.where(there[n], values[n], none) for n in self.holds})
        ages = record("Ages", {n: jnp.where(there[n], none, LONG_AGO) for n in self.hears})
        inner, said = self.inner.first(t, values | held._asdict())
        return Watched(inner, t, held, ages), self._answer(said, values["v_x"], ages)

    def next(self, memory, t, values):
        there = {name: ~jnp.isnan(values[name]) for name in {*self.hears, *self.holds}}
        held = memory.held._replace(
            **{n: jnp.where(there[n], values[n], old) for n, old in memory.held._asdict().items()}
        )
        older = {n: jnp.where(there[n], 0.0, age + (t - memory.t)) for n, age in memory.ages._asdict().items()}
        ages = memory.ages._replace(**older)
        values = values | held._asdict()
        after = self.inner.next(memory.inner, t, values)
        if self.anew:
            heard = lambda ages: jnp.all(jnp.stack(ages) <= LONGEST_SILENCE)
            back = heard(ages) & ~heard(memory.ages)
            after = jax.tree.map(lambda a, b: jnp.where(back, a, b), self.inner.first(t, values), after)
        inner, said = after
        return Watched(inner, t, held, ages), self._answer(said, values["v_x"], ages)

    def _answer(self, said: Answer, v_x, ages) -> Answer:
        told = v_x >= self.slowest
        for age in ages:
            told &= age <= LONGEST_SILENCE
        told &= jnp.abs(said.mean.v_y) <= FARTHEST * jnp.abs(v_x)
        # A standard deviation that is not given is NaN, and NaN is never too wide.
        told &= ~(said.std.sideslip > WIDEST)
        known = jax.tree.map(lambda one: one & told, said.known)
        std = said.std if self.claims else jax.tree.map(lambda one: jnp.full_like(one, jnp.nan), said.std)
        return said._replace(known=known, std=std)


def guard(
    car: CarSpecification, inner: AbstractMethod, hears: tuple[Need, ...] = (), holds: tuple[Need, ...] = (), *,
    anew: bool = False, claims: bool = True,
) -> Guarded:  # fmt: skip
    """The method as a `Guarded` one, with limits for a car of this size."""
    names = lambda needs: tuple(need.channel for need in needs)
    return Guarded(inner, slowest_of(car), names(hears), names(holds), anew, claims)


def size_of(car: CarSpecification) -> float:
    """The car's wheelbase over the usual one. Times and speeds of cars that differ only in size scale with its root (Froude)."""
    return car.wheelbase / USUAL_WHEELBASE


def slowest_of(car: CarSpecification) -> float:
    """`SLOWEST` for a car of this size, m/s."""
    return SLOWEST * size_of(car) ** 0.5


def sideslip_answer(v_y: Any, v_x: Any, known: Any = True, std: Any = None) -> Answer:
    """The answer for a lateral velocity `v_y` (m/s) at a speed `v_x` (m/s); `std` (m/s) is its standard deviation, None if the
    method gives none."""
    speed = jnp.square(v_x) + jnp.square(v_y)
    # d atan2(v_y, v_x) = v_x / (v_x^2 + v_y^2) d v_y, finite at standstill.
    stds = None if std is None else {"v_y": std, "sideslip": std * jnp.abs(v_x) / jnp.maximum(speed, 1e-6)}
    return answer({"v_y": v_y, "sideslip": numerics.arctan2(v_y, v_x)}, stds, known)
