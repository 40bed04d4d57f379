"""A small extended Kalman filter whose measurements come one by one, each when it comes, with noises that follow the row.

The Gaussian filters of `jaxveh.filters` see a `StateSpace`, whose process noise is one law for all rows. A road changes by the
metre and not by the second, so that here the noise is told with every step. A step is a few products of small matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics


class Normal(NamedTuple):
    """A belief: `mean` (n,) and `covariance` (n, n)."""

    mean: Any
    covariance: Any


def normal_of(state_type: Any, means: Mapping[str, Any], stds: Mapping[str, Any], like: Any) -> Normal:
    """Independent states with these means (0 where not named) and standard deviations, of the dtype of `like`."""
    names = state_type._fields
    dtype = jnp.result_type(like)
    stack = lambda values: jnp.stack([jnp.asarray(value, dtype) for value in values])
    mean = stack([means.get(name, 0.0) for name in names])
    return Normal(mean, jnp.diag(jnp.square(stack([stds[name] for name in names]))))


def move(belief: Normal, step: Callable[[Any], Any], variances: Mapping[str, Any], state_type: Any) -> Normal:
    """The belief after `step(state) -> state` with independent noise of these variances."""
    function = lambda vector: jnp.stack(step(state_type(*vector)))
    F = jax.jacfwd(function)(belief.mean)
    dtype = belief.mean.dtype
    Q = jnp.diag(jnp.stack([jnp.asarray(variances.get(name, 0.0), dtype) for name in state_type._fields]))
    return Normal(function(belief.mean), F @ belief.covariance @ F.T + Q)


def correct(
    belief: Normal, error_of: Callable[[Any], Any], variance: Any, here: Any, state_type: Any, gate: float | None = None
) -> Normal:
    """The belief after one measurement with this noise variance, where it is `here`; Joseph's form.

    `error_of(state)`: what was measured less what would be said; finite wherever the belief is. `gate`: an error of more than
    this many of its predicted spreads counts with so much less weight (Huber), None: all count alike.
    """
    error, slope = jax.value_and_grad(lambda vector: error_of(state_type(*vector)))(belief.mean)
    h = -slope
    Ph = belief.covariance @ h
    spread = h @ Ph + variance
    if gate is not None:
        beyond = jnp.square(error) / (gate * gate * spread)
        variance = variance + spread * (numerics.sqrt(jnp.maximum(beyond, 1.0)) - 1.0)
        spread = h @ Ph + variance
    gain = jnp.where(here, Ph / spread, 0.0)
    left = jnp.eye(len(h), dtype=h.dtype) - jnp.outer(gain, h)
    covariance = left @ belief.covariance @ left.T + variance * jnp.outer(gain, gain)
    covariance = 0.5 * (covariance + covariance.T)
    return Normal(belief.mean + gain * jnp.where(here, error, 0.0), jnp.where(here, covariance, belief.covariance))


def spreads(belief: Normal) -> Any:
    """Standard deviations (n,)."""
    return numerics.sqrt(jnp.maximum(jnp.diagonal(belief.covariance), 0.0))


def spread_of(belief: Normal, weights: Mapping[str, Any], state_type: Any) -> Any:
    """The standard deviation of a weighted sum of states."""
    dtype = belief.mean.dtype
    h = jnp.stack([jnp.asarray(weights.get(name, 0.0), dtype) for name in state_type._fields])
    return numerics.sqrt(jnp.maximum(h @ belief.covariance @ h, 0.0))
