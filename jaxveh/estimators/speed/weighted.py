"""A Kalman filter of wheels and accelerometer, with the accelerometer's offset and the road's slope as states."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.method import answer
from jaxveh.estimators.sequential import Belief, innovation, predict, update
from jaxveh.estimators.speed.accelerometer import A_X, AbstractOffsetAndSlope, Felt, never_felt
from jaxveh.estimators.speed.wheels import WHEEL_SPEEDS, AbstractWheelMethod, Wheels
from jaxveh.vehicles import GRAVITY


class WeightedState(NamedTuple):
    """The speed (m/s), the accelerometer's offset and gravity along the road (m/s^2)."""

    v_x: Any
    offset: Any
    slope: Any


class Weighed(NamedTuple):
    """The belief about a `WeightedState`, and the last measured acceleration, `felt`."""

    belief: Belief
    felt: Felt


class Weighted(AbstractWheelMethod, AbstractOffsetAndSlope):
    """A Kalman filter of [v_x, offset, slope], driven by the accelerometer, with the wheels' mean as measurement.

        dv_x/dt = a_x - offset - slope,    doffset/dt = noise,    dslope/dt = -slope / slope_time + noise

    The wheels count less when the car accelerates and when they disagree. The variance of their mean is the sum of squares of
    `wheel` (m/s), `share` (-) of the mean, `by_acceleration` (s) times |a_x|, and `by_spread` (-) times the difference of fastest
    and slowest. Without an accelerometer measurement the speed is a random walk with `unfelt_walk` (m/s/sqrt(s)).

    The speed is known where its standard deviation is below `agreement` (-) of the speed plus `agreement_speed` (m/s). The
    reported standard deviation also includes `radius` (-) of the speed, the common error of all wheels' radii. It does not
    include slip that all wheels share, and is too small then.

    Chen, Gao, Xu 2013, section 2.1, refs 90 to 92.
    """

    wheel: jax.Array = positive("m/s", default=0.05)
    share: jax.Array = positive("-", default=3e-3)
    by_acceleration: jax.Array = positive("s", default=0.05)
    by_spread: jax.Array = positive("-", default=1.0)
    a_x: jax.Array = positive("m/s/sqrt(s)", default=0.02)
    unfelt_walk: jax.Array = positive("m/s/sqrt(s)", default=2.0)
    slope_walk: jax.Array = positive("m/s^2/sqrt(s)", default=0.1)
    radius: jax.Array = positive("-", default=0.015)

    @property
    def needs(self):
        return (*WHEEL_SPEEDS, A_X)

    def begin(self, wheels, values):
        del values
        speed = jnp.where(wheels.spoke, 0.5 + 0.03 * jnp.abs(wheels.mean), 30.0)
        zero = jnp.zeros_like(wheels.t)
        mean = WeightedState(wheels.mean, offset=zero, slope=zero)
        std = jnp.stack(WeightedState(speed, offset=zero + self.offset, slope=zero + self.slope))
        return Weighed(Belief(jnp.stack(mean), jnp.diag(jnp.square(std))), never_felt(wheels.t))

    def next(self, memory, t, values):
        memory, said = super().next(memory, t, values)
        return memory, self._with_bands(memory[1], said)

    def first(self, t, values):
        memory, said = super().first(t, values)
        return memory, self._with_bands(memory[1], said)

    def follow(self, own: Weighed, wheels: Wheels, step, values):
        felt = own.felt.hear(wheels.t, values["a_x"])
        speaks = felt.speaks(wheels.t)
        falls = jnp.exp(-step / self.slope_time)

        def move(mean):
            x = WeightedState(*mean)
            rate = jnp.where(speaks, felt.value - x.offset - x.slope, 0.0)
            return jnp.stack(x._replace(v_x=x.v_x + step * rate, slope=falls * x.slope))

        walks = WeightedState(jnp.where(speaks, self.a_x, self.unfelt_walk), self.offset_walk, self.slope_walk)
        noise = step * jnp.diag(jnp.square(jnp.stack(walks)))
        belief = predict(own.belief, move, noise)
        parts = [self.wheel, self.share * wheels.mean, self.by_spread * (wheels.fastest - wheels.slowest)]
        parts += [self.by_acceleration * jnp.where(speaks, felt.value, 0.0)]
        variance = sum(jnp.square(one) for one in parts)
        mean = jnp.where(wheels.new, wheels.mean, jnp.nan)
        found = innovation(belief, lambda x: WeightedState(*x).v_x, mean, variance)
        belief = update(belief, found, 1.0)
        v_x = WeightedState(*belief.mean).v_x
        return Weighed(belief, felt), v_x, self.is_small(_stds(belief).v_x, v_x)

    def _with_bands(self, own: Weighed, said: Any):
        x, std = WeightedState(*own.belief.mean), _stds(own.belief)
        means = {"v_x": x.v_x, "grade": numerics.arctan(x.slope / GRAVITY), "a_x_offset": x.offset}
        stds = {
            "v_x": numerics.hypot(std.v_x, self.radius * x.v_x),
            "grade": std.slope / GRAVITY,
            "a_x_offset": std.offset,
        }
        return answer(means, stds, said.known.v_x)


def _stds(belief: Belief) -> WeightedState:
    """The standard deviations of the states."""
    return WeightedState(*numerics.sqrt(jnp.maximum(jnp.diagonal(belief.covariance), 0.0)))
