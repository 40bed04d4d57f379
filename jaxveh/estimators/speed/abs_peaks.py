"""Speed of a car with active anti-lock system, from the peaks of the wheels' speeds."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.speed.wheels import AbstractWheelMethod


class Peaks(NamedTuple):
    """Speed `v_x` (m/s) and `slope` (m/s^2, positive in braking); whether the wheels' speeds rise, `up`, and their `highest`
    speed since (m/s); the last `peak` (m/s) and its time `peak_at` (s); for how long a wheel has been `followed` without
    interruption, and for how long not, `alone` (s)."""

    v_x: Any
    slope: Any
    up: Any
    highest: Any
    peak: Any
    peak_at: Any
    followed: Any
    alone: Any


class AdaptiveNonlinear(AbstractWheelMethod):
    """A filter that follows the fastest wheel, and falls with a slope of its own where all wheels fall faster.

    While a wheel has been followed for `slope_time` (s), the slope is that of the wheels: at the start of braking it is the
    car's. Later it is that from each local peak of the fastest wheel to the next, mixed in by `renewal` (-). The speed is also
    drawn to the peak by this share, because a wheel slips least there. A peak is where the mean rate falls below `-turn` after it
    was above `turn` (m/s^2). The slope is limited to `least_slope` and `greatest_slope` (m/s^2). The filter needs no model and no
    accelerometer. If the wheels recover seldom or not fully, it depends on its slope only, as the review criticises: the initial
    slope matters much.

    The speed is known where a wheel was followed within the last `patience` (s).

    Chen, Gao, Xu 2013, section 2.1, refs 19 and 87 (whose filters are not printed there; this is our form of it).
    """

    least_slope: jax.Array = positive("m/s^2", default=0.5)
    greatest_slope: jax.Array = positive("m/s^2", default=10.0)
    renewal: jax.Array = positive("-", default=0.5)
    slack: jax.Array = positive("m/s", default=0.05)
    slope_time: jax.Array = positive("s", default=0.15)
    turn: jax.Array = positive("m/s^2", default=1.0)
    patience: jax.Array = positive("s", default=0.25)

    def begin(self, wheels, values):
        del values
        zero, fastest = jnp.zeros_like(wheels.t), wheels.fastest
        return Peaks(fastest, zero + self.least_slope, jnp.asarray(False), fastest, fastest, wheels.t, zero, zero)

    def follow(self, own: Peaks, wheels, step, values):
        del values
        fastest, rate = wheels.fastest, wheels.mean_rate
        fallen = own.v_x - own.slope * step
        # A wheel that has been followed is trusted as long as it decelerates no faster than a car can.
        steepest = jnp.where(own.followed > self.slope_time, self.greatest_slope, own.slope)
        follows = wheels.spoke & (fastest >= own.v_x - steepest * step - self.slack)
        v_x = jnp.where(follows, fastest, jnp.maximum(fallen, 0.0))
        followed = jnp.where(follows, own.followed + step, 0.0)
        # Wheels that decelerate faster than any car slip, and give no information on the car.
        learns = (followed > self.slope_time) & (-rate < self.greatest_slope)
        mixed = 1.0 - jnp.exp(-step / self.slope_time)
        slope = jnp.where(learns, own.slope + mixed * (-rate - own.slope), own.slope)
        over = own.up & (rate < -self.turn) & wheels.spoke
        waited = wheels.t - own.peak_at
        between = (own.peak - own.highest) / numerics.or_one(waited, waited > 0.0)
        slope = jnp.where(over & ~learns & (waited > 0.05), slope + self.renewal * (between - slope), slope)
        v_x = jnp.where(over & ~follows, v_x + self.renewal * (own.highest - v_x), v_x)
        up = jnp.where(over, False, own.up | (rate > self.turn))
        anew = learns | over
        said = Peaks(
            v_x,
            jnp.clip(slope, self.least_slope, self.greatest_slope),
            up,
            jnp.where(up & own.up, jnp.maximum(own.highest, fastest), fastest),
            jnp.where(anew, jnp.where(learns, v_x, own.highest), own.peak),
            jnp.where(anew, wheels.t, own.peak_at),
            followed,
            jnp.where(follows, 0.0, own.alone + step),
        )
        return said, v_x, wheels.spoke & (said.alone <= self.patience)
