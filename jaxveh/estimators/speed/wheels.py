"""Speed from the wheels alone: the fastest, the slowest, and either one limited to the rates that a car can have."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.numerics import smooth_step
from jaxveh.vehicles import kit as vehicles

WHEEL_SPEEDS = tuple(Need(f"wheel_speed_{at}", "m/s") for at in vehicles.CORNERS)

PATIENCE = 0.1
"""s: time for which a sample is held."""


class Wheels(NamedTuple):
    """The last measurements of the wheels: `speed` (m/s) and their times `at` (s), (4,) each; the low-passed speeds `smooth`
    (m/s) and their `rate` (m/s^2); the row's time `t` (s); `new`: whether the row has a measurement of any wheel."""

    speed: Any
    at: Any
    smooth: Any
    rate: Any
    t: Any
    new: Any

    @property
    def fresh(self) -> jax.Array:
        """Which wheels have a recent measurement, (4,) booleans."""
        return self.t - self.at <= PATIENCE

    @property
    def spoke(self) -> jax.Array:
        """Whether any wheel has a recent measurement."""
        return jnp.any(self.fresh)

    @property
    def fastest(self) -> jax.Array:
        """Speed of the fastest wheel, m/s; 0 where no wheel has a recent measurement."""
        return jnp.where(self.spoke, numerics.largest(jnp.where(self.fresh, self.speed, -jnp.inf)), 0.0)

    @property
    def slowest(self) -> jax.Array:
        """Speed of the slowest wheel, m/s; 0 where no wheel has a recent measurement."""
        return jnp.where(self.spoke, numerics.smallest(jnp.where(self.fresh, self.speed, jnp.inf)), 0.0)

    @property
    def mean(self) -> jax.Array:
        """Mean speed of the wheels, m/s."""
        return self._mean(self.speed)

    @property
    def mean_rate(self) -> jax.Array:
        """Mean rate of the wheels' speeds, m/s^2."""
        return self._mean(self.rate)

    def agree(self, share: Any, speed: Any) -> jax.Array:
        """Whether the fastest and the slowest differ by less than `share` (-) of their mean plus `speed` (m/s)."""
        return self.spoke & (self.fastest - self.slowest < share * jnp.abs(self.mean) + speed)

    def _mean(self, values):
        count = jnp.maximum(jnp.sum(self.fresh.astype(values.dtype)), 1.0)
        return jnp.sum(jnp.where(self.fresh, values, 0.0)) / count


def wheel_values(values: dict[str, Any]) -> jax.Array:
    """The wheels' speeds in a row, (4,), NaN where one is not measured."""
    return jnp.stack([values[need.channel] for need in WHEEL_SPEEDS])


def first_wheels(t: Any, values: dict[str, Any]) -> Wheels:
    """The wheels after the first row."""
    speeds = wheel_values(values)
    there = ~jnp.isnan(speeds)
    said = jnp.where(there, speeds, 0.0)
    return Wheels(said, jnp.where(there, t, -jnp.inf), said, jnp.zeros_like(said), t, jnp.any(there))


def next_wheels(before: Wheels, t: Any, values: dict[str, Any], smoothing: Any) -> Wheels:
    """The wheels after the next row; rates are those of a first-order low-pass filter with the time constant `smoothing` (s),
    which is reset for a wheel after a gap."""
    speeds = wheel_values(values)
    there, late = ~jnp.isnan(speeds), t - before.at > PATIENCE
    said = jnp.where(there, speeds, before.speed)
    waited = jnp.where(there & ~late, t - before.at, 0.0)
    mixed = 1.0 - jnp.exp(-waited / smoothing)
    start = jnp.where(late & there, said, before.smooth)
    smooth = start + mixed * (said - start)
    rate = jnp.where(there, jnp.where(late, 0.0, (said - smooth) / smoothing), before.rate)
    return Wheels(said, jnp.where(there, t, before.at), smooth, rate, t, jnp.any(there))


class AbstractWheelMethod(AbstractMethod):
    """A method that first processes the wheels' speeds. Its memory is that of the wheels and its own.

    `smoothing` (s): time constant of the wheels' rates. Wheels agree where the fastest and the slowest differ by less than
    `agreement` (-) of their mean plus `agreement_speed` (m/s).
    """

    smoothing: jax.Array = positive("s", default=0.1)
    agreement: jax.Array = positive("-", default=0.02)
    agreement_speed: jax.Array = positive("m/s", default=0.1)

    @property
    def needs(self):
        return WHEEL_SPEEDS

    @abc.abstractmethod
    def begin(self, wheels: Wheels, values: dict[str, Any]) -> Any:
        """The method's own memory before the first answer."""

    @abc.abstractmethod
    def follow(self, own: Any, wheels: Wheels, step: Any, values: dict[str, Any]) -> tuple[Any, Any, Any]:
        """The method's own memory after a row, `step` (s) after the last one, the speed (m/s), and whether it is known."""

    def agree(self, wheels: Wheels) -> jax.Array:
        """Whether the wheels agree."""
        return wheels.agree(self.agreement, self.agreement_speed)

    def is_small(self, error: Any, v_x: Any) -> Any:
        """Whether an error of the speed (m/s) is below `agreement` of the speed plus `agreement_speed`."""
        return error < self.agreement * jnp.abs(v_x) + self.agreement_speed

    def first(self, t, values):
        wheels = first_wheels(t, values)
        return self._say(self.begin(wheels, values), wheels, jnp.zeros_like(t), values)

    def next(self, memory, t, values):
        before, own = memory
        wheels = next_wheels(before, t, values, self.smoothing)
        return self._say(own, wheels, jnp.maximum(t - before.t, 0.0), values)

    def _say(self, own, wheels, step, values):
        own, v_x, known = self.follow(own, wheels, step, values)
        return (wheels, own), answer({"v_x": v_x}, known=known)


class AbstractChosenWheel(AbstractWheelMethod):
    """The speed of one of the four wheels, chosen in each row; the last speed is held where no wheel has a measurement.

    The rates that a car can have are between `-most_deceleration` and `most_acceleration` (m/s^2).
    """

    most_deceleration: jax.Array = positive("m/s^2", default=10.0)
    most_acceleration: jax.Array = positive("m/s^2", default=6.0)

    @abc.abstractmethod
    def choose(self, wheels: Wheels) -> Any:
        """The speed of the chosen wheel, or between two, m/s."""


class AbstractOneWheel(AbstractChosenWheel):
    """The chosen wheel's speed as it is, which is known where the wheels agree and a car can have their rate: if all wheels slip
    alike, they also agree."""

    def begin(self, wheels, values):
        del values
        return self.choose(wheels)

    def follow(self, own, wheels, step, values):
        del step, values
        v_x = jnp.where(wheels.spoke, self.choose(wheels), own)
        rate = wheels.mean_rate
        can_be = (rate > -self.most_deceleration) & (rate < self.most_acceleration)
        return v_x, v_x, self.agree(wheels) & can_be


class FastestWheel(AbstractOneWheel):
    """The review's maximum: the wheel that slips least on a braking car (Chen, Gao, Xu 2013, section 2.1, ref 86)."""

    def choose(self, wheels):
        return wheels.fastest


class SlowestWheel(AbstractOneWheel):
    """The review's minimum: the wheel that slips least on a driven car (Chen, Gao, Xu 2013, section 2.1, ref 86)."""

    def choose(self, wheels):
        return wheels.slowest


class AbstractSlopeLimited(AbstractChosenWheel):
    """The chosen wheel's speed, with its rate limited to those that a car can have.

    It is known where the wheels agree and neither limit was active in the last `patience` (s).
    """

    most_acceleration: jax.Array = positive("m/s^2", default=5.0)
    patience: jax.Array = positive("s", default=0.3)

    def begin(self, wheels, values):
        del values
        return Slope(self.choose(wheels), jnp.zeros_like(wheels.t))

    def follow(self, own, wheels, step, values):
        del values
        wish = jnp.where(wheels.spoke, self.choose(wheels), own.v_x)
        v_x = jnp.clip(wish, own.v_x - self.most_deceleration * step, own.v_x + self.most_acceleration * step)
        # The quantisation of the sensor's teeth also makes steps, smaller than this.
        held = jnp.abs(wish - v_x) > 0.5 * self.agreement_speed
        free = jnp.where(held, 0.0, own.free + step)
        return Slope(v_x, free), v_x, self.agree(wheels) & (free >= self.patience)


class Slope(NamedTuple):
    """The speed `v_x` (m/s), and the time since a limit was last active, `free` (s)."""

    v_x: Any
    free: Any


class SlopeLimited(AbstractSlopeLimited):
    """The fastest wheel with limited rates (Chen, Gao, Xu 2013, section 2.1, ref 86: the slope method)."""

    def choose(self, wheels):
        return wheels.fastest


class Combined(AbstractSlopeLimited):
    """The fastest wheel where the car brakes, the slowest where it is driven, a mean in between, with limited rates.

    Braking and driving are distinguished by the wheels' mean rate; the transition ends at `edge` (m/s^2) on either side.
    (Chen, Gao, Xu 2013, section 2.1, ref 86: the combined method.)
    """

    edge: jax.Array = positive("m/s^2", default=0.5)

    def choose(self, wheels):
        drives = smooth_step(0.5 + 0.5 * wheels.mean_rate / self.edge)
        return drives * wheels.slowest + (1.0 - drives) * wheels.fastest
