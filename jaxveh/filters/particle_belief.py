"""The belief of a particle filter."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.filters.choosing import log_of
from jaxveh.statespace import AbstractBelief


class ParticleBelief(AbstractBelief):
    """Weighted particles: the state's NamedTuple with (N,) in each field, and normalised weights (N,).

    `ancestors` (N,): for each particle, the index of its ancestor in the belief before.
    """

    particles: Any
    weights: jax.Array
    ancestors: jax.Array
    key: Any
    t: Any
    u: Any
    count: Any

    @property
    def mean(self):
        """Weighted mean of each field (parameters on the real line)."""
        return jax.tree.map(lambda field: numerics.total(self.weights * field), self.particles)

    @property
    def std(self):
        """Weighted standard deviation of each field."""
        return jax.tree.map(lambda field, m: _std(self.weights, field - m), self.particles, self.mean)

    @property
    def covariance(self):
        """The weighted covariance (n, n), in the order of the state's fields."""
        centred = jnp.stack([field - m for field, m in zip(self.particles, self.mean, strict=True)])
        return (centred * self.weights) @ centred.T

    def quantile(self, share: float):
        """The weighted quantile of each field: the smallest value with at least `share` of the weight at or below it."""

        def of(field):
            order = jnp.argsort(field)
            reached = jnp.cumsum(self.weights[order]) >= share
            return field[order][jnp.argmax(reached)]

        return jax.tree.map(of, self.particles)

    def sample(self, key, draws):
        chosen = jax.random.categorical(key, log_of(self.weights), shape=(draws,))
        return jax.tree.map(lambda field: field[chosen], self.particles)

    def moments(self, model):
        shown = model.report(self.t, self.particles, self.u)
        n = self.weights.shape[0]
        shown = jax.tree.map(lambda field: jnp.broadcast_to(field, (n,)), shown)
        # Deviations from the first particle keep the digits of E[x^2] - E[x]^2, and both moments need one pass only.
        base = jax.tree.map(lambda field: jax.lax.stop_gradient(field[0]), shown)
        first = jax.tree.map(lambda field, b: numerics.total(self.weights * (field - b)), shown, base)
        second = jax.tree.map(lambda field, b: numerics.total(self.weights * (field - b) ** 2), shown, base)
        mean = jax.tree.map(lambda b, m: b + m, base, first)
        std = jax.tree.map(lambda m, s: numerics.sqrt(jnp.maximum(s - m**2, 0)), first, second)
        return mean, std


def _std(weights, deviation):
    return numerics.sqrt(numerics.total(weights * deviation**2))
