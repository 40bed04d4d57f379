"""A random walk of the friction's logarithm, followed by a filter of single residuals."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.method import Answer, answer

LOWEST_FRICTION, HIGHEST_FRICTION = 0.05, 1.5
"""Bounds of a friction."""


class LogFriction(NamedTuple):
    """Mean and variance of ln mu, and the squared innovations over their variances, averaged."""

    mean: Any
    variance: Any
    surprise: Any


class AbstractFollower(eqx.Module):
    """A Kalman filter of ln mu, which returns to the `usual` friction (-) within `memory` (s) where there is no information.
    Friction is forgotten where innovations are too large for its variance, so that a jump is followed.

    `spread` (-): standard deviation of ln mu without information; `correlation` (s): residuals closer than this are fully
    correlated; `known` (-): up to this standard deviation of ln mu the friction is known; `surprise` (-): limit of the averaged
    squared innovations over their variance; `attention` (s): time constant of this average.
    """

    usual: jax.Array = positive("-", default=0.8)
    spread: jax.Array = positive("-", default=0.6)
    memory: jax.Array = positive("s", default=40.0)
    correlation: jax.Array = positive("s", default=0.2)
    known: jax.Array = positive("-", default=0.15)
    surprise: jax.Array = positive("-", default=6.0)
    attention: jax.Array = positive("s", default=0.3)

    def noise_variance(self, noise, dt):
        """The variance of a residual with the standard deviation `noise`, `dt` (s) after the last one, so that correlated ones
        count as one."""
        return jnp.square(noise) * jnp.maximum(self.correlation / jnp.maximum(dt, 1e-3), 1.0)

    def watch(self, last, error, variance, dt, here):
        """The averaged squares of `error` over its `variance`, after `last` of them and `dt` (s), and whether the friction has
        jumped; `here`: whether the error counts."""
        share = 1.0 - jnp.exp(-dt / self.attention)
        squared = jnp.square(error) / variance
        average = last + jnp.where(here, share, 0.0) * (jnp.minimum(squared, 50.0) - last)
        return average, here & (average > self.surprise)


class Follower(AbstractFollower):
    """The filter of ln mu alone."""

    def start(self) -> LogFriction:
        """The belief before any information."""
        return LogFriction(jnp.log(self.usual), jnp.square(self.spread), jnp.ones_like(self.usual))

    def next(self, last: LogFriction, dt, residual, noise, here) -> LogFriction:
        """The belief after `dt` (s) and a residual. `residual` is a function of ln mu that is zero at the truth, except for
        `noise` (its standard deviation); `here`: whether it was measured."""
        stays = jnp.exp(-dt / self.memory)
        mean = jnp.log(self.usual) + stays * (last.mean - jnp.log(self.usual))
        variance = stays**2 * last.variance + (1.0 - stays**2) * jnp.square(self.spread)
        slope_at = lambda x: jax.jvp(residual, (x,), (jnp.ones_like(x),))
        error, slope = slope_at(mean)
        rough = self.noise_variance(noise, dt)
        expected = jnp.square(slope) * variance + jnp.square(noise)
        average, jumped = self.watch(last.surprise, error, expected, dt, here)
        variance = jnp.where(jumped, jnp.square(self.spread), variance)
        total = jnp.square(slope) * variance + rough
        gain = jnp.where(here, -variance * slope / total, 0.0)
        step = jnp.clip(gain * jnp.where(here, error, 0.0), -0.5, 0.5)
        after = jnp.where(here, variance * rough / total, variance)
        mean = jnp.clip(mean + step, jnp.log(LOWEST_FRICTION), jnp.log(HIGHEST_FRICTION))
        return LogFriction(mean, after, jnp.where(jumped, 1.0, average))

    def says(self, state: LogFriction, moves) -> Answer:
        """The answer `friction` of a belief; `moves`: whether the car does, without which nothing is known."""
        mu, known = jnp.exp(state.mean), moves & (state.variance < jnp.square(self.known))
        return answer({"friction": mu}, {"friction": mu * jnp.sqrt(state.variance)}, known)
