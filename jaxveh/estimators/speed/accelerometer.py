"""Speed from the accelerometer, whose offset is learned from the wheels."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.speed.free_wheels import AbstractFreeWheels
from jaxveh.estimators.speed.wheels import PATIENCE, WHEEL_SPEEDS, Wheels

A_X = Need("a_x", "m/s^2")


class Felt(NamedTuple):
    """The last measurement of a channel, `value`, and its time `at` (s)."""

    value: Any
    at: Any

    def hear(self, t: Any, value: Any) -> Felt:
        """The same, updated with a row's value, NaN if there is none."""
        there = ~jnp.isnan(value)
        return Felt(jnp.where(there, value, self.value), jnp.where(there, t, self.at))

    def speaks(self, t: Any) -> Any:
        """Whether the channel has a recent measurement."""
        return t - self.at <= PATIENCE


class AbstractOffsetAndSlope(eqx.Module):
    """What a filter assumes of two accelerations (m/s^2): the accelerometer's offset and the `slope`, gravity along the road.

    `offset`, `slope` (m/s^2): standard deviations at the start; `offset_walk`, `slope_walk` (m/s^2 per root second): random
    walks. The slope decays to zero with `slope_time` (s). The two are only distinguished by how fast they change.
    """

    slope: jax.Array = positive("m/s^2", default=0.3)
    slope_time: jax.Array = positive("s", default=15.0)
    slope_walk: jax.Array = positive("m/s^2/sqrt(s)", default=0.15)
    offset: jax.Array = positive("m/s^2", default=0.12)
    offset_walk: jax.Array = positive("m/s^2/sqrt(s)", default=2e-3)


def never_felt(t: Any) -> Felt:
    """A channel before its first measurement."""
    return Felt(jnp.zeros_like(t), jnp.full_like(t, -jnp.inf))


class Integrated(NamedTuple):
    """Speed `v_x` (m/s), `offset` (m/s^2), the last measured acceleration `felt`, and the time since wheels last corrected the
    speed, `alone` (s)."""

    v_x: Any
    offset: Any
    felt: Felt
    alone: Any


class AccelerometerIntegral(AbstractFreeWheels):
    """The integral of the accelerometer less its offset, from the speed at which the wheels last rolled freely.

    Where they roll freely, the offset, which includes the slope of the road, is learned with `offset_time` (s) from the measured
    acceleration less the wheels' rate.

    The speed is known as long as the integral of an offset error of `offset_error` (m/s^2) is below `agreement` (-) of the speed
    plus `agreement_speed` (m/s).

    Chen, Gao, Xu 2013, section 2.1, refs 88 (wheels' acceleration corrects the offset; wheels must roll purely) and 89 (mean
    rates over a time).
    """

    offset_time: jax.Array = positive("s", default=2.0)
    offset_error: jax.Array = positive("m/s^2", default=0.1)

    @property
    def needs(self):
        return (*WHEEL_SPEEDS, A_X)

    def begin(self, wheels, values):
        del values
        zero = jnp.zeros_like(wheels.t)
        return Integrated(wheels.mean, zero, never_felt(wheels.t), jnp.where(wheels.spoke, 0.0, jnp.inf))

    def follow(self, own: Integrated, wheels: Wheels, step, values):
        felt = own.felt.hear(wheels.t, values["a_x"])
        speaks = felt.speaks(wheels.t)
        rate = jnp.where(speaks, felt.value - own.offset, 0.0)
        v_x, free, strange = self.integrate(own.v_x, wheels, step, rate, rate)
        offset = own.offset - jnp.where(free & speaks, 1.0 - jnp.exp(-step / self.offset_time), 0.0) * strange
        alone = jnp.where(free, 0.0, own.alone + step)
        return Integrated(v_x, offset, felt, alone), v_x, speaks & self.is_small(self.offset_error * alone, v_x)
