"""The strong tracking filter: a fading factor where innovations are larger than the filter predicts."""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.wrappers.base import AbstractRemembering, Remembering
from jaxveh.filters.wrappers.innovation import innovation


class StrongTracking(AbstractRemembering):
    """`inner`, whose predicted covariance is inflated when innovations are too large for it (D. Zhou & P. Frank 1996).

        V <- (rho V + e e^T) / (1 + rho),    lambda = max(1, trace(V - beta R) / trace(H P H^T))

    with V = e e^T in a channel's first row, and each channel divided by the standard deviation of its noise, so that
    units do not matter; rho = `forgetting`, beta = `softening`, lambda at most `ceiling`. The whole predicted
    covariance is inflated, whereas the source does not inflate the process noise. The filter follows sudden changes
    that the model does not describe, and also outliers.
    """

    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    inner: AbstractGaussianFilter
    forgetting: float = eqx.field(static=True, default=0.95)
    softening: float = eqx.field(static=True, default=1.0)
    ceiling: float = eqx.field(static=True, default=100.0)

    def __check_init__(self):
        check("StrongTracking.forgetting", self.forgetting, lambda v: (v > 0) & (v <= 1), "above 0 and at most 1")
        check("StrongTracking.softening", self.softening, lambda v: v >= 1, "at least 1")
        check("StrongTracking.ceiling", self.ceiling, lambda v: v >= 1, "at least 1")

    def start(self, model):
        dtype = model.dtype
        # V divided by the noise variance; negative before a channel's first row.
        return jnp.full(len(model.channels), -1.0, dtype)

    def believed_model(self, model, memory):
        return model

    def update(self, model, belief, row):
        found = innovation(self.inner, model, belief.inside, row)
        squared = jnp.square(found.error) / found.noise
        old = belief.memory
        mixed = jnp.where(old < 0, squared, (self.forgetting * old + squared) / (1.0 + self.forgetting))
        squares = jnp.where(found.here, mixed, old)
        excess = jnp.where(found.here, squares - self.softening, 0.0)
        expected = jnp.sum(jnp.where(found.here, found.expected / found.noise, 0.0))
        some = expected > 0
        factor = jnp.where(some, jnp.sum(excess) / numerics.or_one(expected, some), 1.0)
        factor = jnp.clip(factor, 1.0, self.ceiling)
        after, info = self.inner.update(model, belief.inside.inflate(factor), row)
        return Remembering(after, squares), info
