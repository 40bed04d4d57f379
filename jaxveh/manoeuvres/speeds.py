"""Demanded speeds over time."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import (
    check,
    check_at_least,
    check_finite,
    check_known,
    check_positive,
    check_single,
    check_whole,
)
from jaxveh._core.own_results import number
from jaxveh._core.parameter import check_parameters, parameter
from jaxveh.manoeuvres.base import as_time, check_speed
from jaxveh.numerics import gauss_markov_harmonics, smooth_ramp, sum_of_harmonics


class AbstractSpeed(Checked, eqx.Module):
    """A demanded speed as a smooth function of time; array leaves are its parameters.

    **Raises** `InputError` for parameters outside their domain.
    """

    _contract = contract(v_x=number)

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def v_x(self, t: Any) -> jax.Array:
        """The speed at the times t (s), m/s, in the shape of t."""

    def at(self, t: Any) -> tuple[jax.Array, jax.Array]:
        """The speed (m/s) and its rate (m/s^2) at the times t (s)."""
        t = as_time(t, jax.tree.leaves(self)[0])
        return jax.jvp(self.v_x, (t,), (jnp.ones_like(t),))


class SteadySpeed(AbstractSpeed):
    """A constant `speed` (m/s). **Raises** `InputError` unless it is between 0 and 150 m/s."""

    speed: jax.Array = parameter("m/s", scale=20.0)

    def __check_init__(self):
        check_speed("speed", self.speed)

    def v_x(self, t: Any) -> jax.Array:
        return jnp.broadcast_to(self.speed, jnp.shape(t))


class ChangingSpeed(AbstractSpeed):
    """A speed that changes linearly from one value to another, with rounded corners.

    `before`, `after` (m/s): the two speeds; `start` (s): the time at which the change begins; `time` (s): its length;
    `edge` (s, default 1): the time over which the corners are rounded.

    **Raises** `InputError` for speeds that are not between 0 and 150 m/s, or times that are not positive.
    """

    before: jax.Array = parameter("m/s", scale=20.0)
    after: jax.Array = parameter("m/s", scale=20.0)
    start: float = eqx.field(static=True, default=1.0)
    time: float = eqx.field(static=True, default=10.0)
    edge: float = eqx.field(static=True, default=1.0)

    def __check_init__(self):
        check_speed("before", self.before)
        check_speed("after", self.after)
        check_known(start=self.start, time=self.time, edge=self.edge)
        check_finite("start", self.start)
        check_positive("time", self.time, "s")
        check_positive("edge", self.edge, "s")
        check("edge", self.edge, lambda v: v <= self.time, f"at most time = {self.time:g} s")

    def v_x(self, t: Any) -> jax.Array:
        half = self.edge / 2
        gone = smooth_ramp(t - self.start, half) - smooth_ramp(t - self.start - self.time, half)
        return self.before + (self.after - self.before) * (gone / self.time)


class WaveringSpeed(AbstractSpeed):
    """A speed that varies randomly about its mean, as harmonics of equal energy (drawn by `wavering_speed`).

    `mean`, `std` (m/s), `frequencies` (Hz) and `phases` (rad), (n,) each. The speed does not fall below zero.
    """

    mean: jax.Array = parameter("m/s", scale=20.0)
    std: jax.Array = parameter("m/s", scale=1.0)
    frequencies: jax.Array = parameter("Hz", scale=0.1)
    phases: jax.Array = parameter("rad", scale=1.0)

    def v_x(self, t: Any) -> jax.Array:
        wanted = self.mean + self.std * sum_of_harmonics(as_time(t, self.mean), self.frequencies, self.phases)
        return smooth_ramp(wanted, 0.5)


def wavering_speed(
    mean, std, key: jax.Array, *, time: float = 10.0, fastest: float = 5.0, count: int = 40
) -> WaveringSpeed:
    """A speed about `mean` with the standard deviation `std` (m/s): a Gauss-Markov process with the correlation time `time` (s).

    It has no periods shorter than `fastest` (s), so that a car can follow it. The `key` determines the speed.

    **Raises** `InputError` for values out of range.
    """
    check_speed("mean", mean)
    check_at_least("std", std, 0.0)
    check_single(time=time, fastest=fastest)
    check_positive("time", time, "s")
    check_positive("fastest", fastest, "s")
    check_whole("count", count)
    return WaveringSpeed(mean, std, *gauss_markov_harmonics(key, time, 1.0 / fastest, count))
