"""Speed of a car under its anti-lock system, from the wheels' peaks."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.speed.wheels import AbstractWheelMethod


class Peaks(NamedTuple):
    """Speed (m/s) and slope (m/s^2, positive in braking); speed and time (s) of the last peak; whether it follows a wheel, and
    since when (s)."""

    v_x: Any
    slope: Any
    peak: Any
    peak_at: Any
    follows: Any
    since: Any


class AdaptiveNonlinear(AbstractWheelMethod):
    """A filter that follows the fastest wheel up, and falls with a slope of its own where all wheels fall faster.

    The slope is that of the wheels at the start of braking, as long as one is followed; then, at each local peak at which a
    wheel comes up to the speed again, that from the last peak to this one, mixed in by `renewal` (-). It stays between
    `least_slope` and `greatest_slope` (m/s^2). Without model and accelerometer; an anti-lock system that lets wheels come
    up seldom, or not wholly, leaves it to its slope, which is what the review says against it: the start counts for much.

    Known where a wheel was followed within `patience` (s).

    Chen, Gao, Xu 2013, section 2.1, refs 19 and 87 (whose filters are not printed there; this is our form of it).
    """

    least_slope: jax.Array = positive("m/s^2", default=0.5)
    greatest_slope: jax.Array = positive("m/s^2", default=10.0)
    renewal: jax.Array = positive("-", default=0.5)
    slack: jax.Array = positive("m/s", default=0.05)
    slope_time: jax.Array = positive("s", default=0.1)
    patience: jax.Array = positive("s", default=0.25)

    def begin(self, wheels, values):
        del values
        zero = jnp.zeros_like(wheels.t)
        return Peaks(wheels.fastest, zero + self.least_slope, wheels.fastest, wheels.t, jnp.asarray(True), zero)

    def follow(self, own: Peaks, wheels, step, values):
        del values
        fallen = own.v_x - own.slope * step
        follows = wheels.spoke & (wheels.fastest >= fallen - self.slack)
        v_x = jnp.where(follows, wheels.fastest, jnp.maximum(fallen, 0.0))
        waited = wheels.t - own.peak_at
        between = (own.peak - v_x) / jnp.where(waited > 0.0, waited, 1.0)
        at_peak = follows & ~own.follows & (waited > 0.05)
        mixed = 1.0 - jnp.exp(-step / self.slope_time)
        slope = jnp.where(follows, own.slope + mixed * (-wheels.mean_rate - own.slope), own.slope)
        slope = jnp.where(at_peak, own.slope + self.renewal * (between - own.slope), slope)
        slope = jnp.clip(slope, self.least_slope, self.greatest_slope)
        peak, peak_at = jnp.where(follows, v_x, own.peak), jnp.where(follows, wheels.t, own.peak_at)
        since = jnp.where(follows, 0.0, own.since + step)
        return Peaks(v_x, slope, peak, peak_at, follows, since), v_x, wheels.spoke & (since <= self.patience)
