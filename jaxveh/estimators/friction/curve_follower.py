"""The logarithms of friction and of both axles' stiffnesses, followed by a filter of single residuals."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.friction.scalar import HIGHEST_FRICTION, LOWEST_FRICTION, AbstractFollower
from jaxveh.estimators.method import Answer, answer


class CurveBelief(NamedTuple):
    """Mean (3,) and covariance (3, 3) of ln mu and of the logarithms of front and rear stiffness over the file's; the squared
    innovations over their variances, averaged."""

    mean: Any
    covariance: Any
    surprise: Any

    @property
    def log_friction(self):
        """ln mu."""
        return self.mean[0]

    @property
    def stiffer(self):
        """Logarithms of front and rear stiffness over the file's."""
        return (self.mean[1], self.mean[2])


class CurveFollower(AbstractFollower):
    """The filter of ln mu that also estimates the stiffnesses: a force below the file's curve means a softer tyre or a slippery
    road, and the two can only be distinguished where the curve bends.

    Every row updates the stiffness; rows where the curve bends also update the friction. Without information stiffness returns
    to the file's within `stiffness_memory` (s), with a standard deviation of its logarithm of `stiffness_spread` (-).
    """

    stiffness_spread: jax.Array = positive("-", default=0.35)
    stiffness_memory: jax.Array = positive("s", default=100.0)

    def start(self) -> CurveBelief:
        """The belief before any information."""
        mean, covariance = self._nothing()
        return CurveBelief(mean, covariance, jnp.ones_like(self.usual))

    def _nothing(self):
        zero = jnp.zeros_like(self.usual)
        stiff = self.stiffness_spread + zero
        return jnp.stack([jnp.log(self.usual), zero, zero]), jnp.diag(
            jnp.square(jnp.stack([self.spread, stiff, stiff]))
        )

    def next(self, last: CurveBelief, dt, residual, noise, here, tells) -> CurveBelief:
        """The belief after `dt` (s) and a residual. `residual` is a function of the mean (3,) that is zero at the truth, except
        for `noise` (its standard deviation); `here`: whether it was measured; `tells`: whether it may update the friction."""
        mean, P = self._ahead(last, dt)
        error, slope = jax.value_and_grad(residual)(mean)
        rough = self.noise_variance(noise, dt)
        expected = slope @ P @ slope + jnp.square(noise)
        average, jumped = self.watch(last.surprise, error, expected, dt, here & tells)
        P = jnp.where(jumped, self._forgets_friction(P), P)
        along = P @ slope
        gain = jnp.where(here, -along / (slope @ along + rough), 0.0)
        # A row that may not update the friction leaves its mean and its variance.
        gain = jnp.where(jnp.asarray([True, False, False]) & ~tells, 0.0, gain)
        mean = mean + jnp.clip(gain * jnp.where(here, error, 0.0), -0.5, 0.5)
        mean = mean.at[0].set(jnp.clip(mean[0], jnp.log(LOWEST_FRICTION), jnp.log(HIGHEST_FRICTION)))
        left = jnp.eye(3, dtype=P.dtype) + jnp.outer(gain, slope)
        P = numerics.symmetric(left @ P @ left.T) + rough * jnp.outer(gain, gain)
        return CurveBelief(mean, P, jnp.where(jumped, 1.0, average))

    def _ahead(self, last: CurveBelief, dt):
        usual, nothing = self._nothing()
        stays = jnp.exp(-dt / jnp.stack([self.memory, self.stiffness_memory, self.stiffness_memory]))
        mean = usual + stays * (last.mean - usual)
        return mean, stays[:, None] * last.covariance * stays + (1.0 - jnp.diag(stays**2)) * nothing

    def _forgets_friction(self, P):
        return P.at[0, :].set(0.0).at[:, 0].set(0.0).at[0, 0].set(jnp.square(self.spread))

    def says(self, state: CurveBelief, moves) -> Answer:
        """The answer `friction` of a belief; `moves`: whether the car does, without which nothing is known."""
        mu, variance = jnp.exp(state.log_friction), state.covariance[0, 0]
        std, known = mu * numerics.sqrt(jnp.maximum(variance, 0.0)), moves & (variance < jnp.square(self.known))
        return answer({"friction": mu}, {"friction": std}, known)
