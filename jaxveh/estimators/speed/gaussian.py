"""A Gaussian belief about a few named scalars, and its update by one number at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh.numerics import symmetric


class Belief(NamedTuple):
    """Mean (n,) and covariance (n, n), in the order of the state's fields."""

    mean: Any
    covariance: Any


class Innovation(NamedTuple):
    """What a number says beyond the belief: `residual`, its expected `variance`, and the slope (n,) of what was expected."""

    residual: Any
    variance: Any
    slope: Any


def predict(belief: Belief, transition: Callable[[Any], Any], noise: Any) -> Belief:
    """The belief after the `transition` of a mean (n,), with process noise of covariance `noise` (n, n)."""
    slopes = jax.jacfwd(transition)(belief.mean)
    covariance = symmetric(slopes @ belief.covariance @ slopes.T) + noise
    return Belief(transition(belief.mean), covariance)


def innovation(belief: Belief, expect: Callable[[Any], Any], value: Any, variance: Any) -> Innovation:
    """What `value`, measured with noise of `variance`, says beyond `expect(mean)`; nothing at all where it is NaN."""
    expected, slope = jax.value_and_grad(expect)(belief.mean)
    there = ~jnp.isnan(value)
    residual = jnp.where(there, value, expected) - expected
    slope = jnp.where(there, slope, 0.0)
    return Innovation(residual, slope @ belief.covariance @ slope + variance, slope)


def update(belief: Belief, found: Innovation, trust: Any) -> Belief:
    """The belief after an innovation whose noise is by `1 / trust` larger than told; 0 leaves it as it is.

    `trust` is of the whole expected variance, so that the gain is the Kalman gain times `trust`.
    """
    along = belief.covariance @ found.slope
    gain = trust * along / found.variance
    mean = belief.mean + gain * found.residual
    return Belief(mean, symmetric(belief.covariance - jnp.outer(gain, along)))


def innovations(belief: Belief, expect: Callable[[Any], Any], values: Any, variances: Any) -> Innovation:
    """The same of several numbers (m,) at once, whose noises are independent: fields (m,), slopes (m, n)."""
    expected, slopes = expect(belief.mean), jax.jacfwd(expect)(belief.mean)
    there = ~jnp.isnan(values)
    residuals = jnp.where(there, values, expected) - expected
    slopes = jnp.where(there[:, None], slopes, 0.0)
    return Innovation(residuals, jnp.sum(slopes @ belief.covariance * slopes, axis=1) + variances, slopes)


def update_by_each(belief: Belief, found: Innovation, trusts: Any) -> Belief:
    """The belief after `innovations`, one after the other, each of its trust; about one point, so that their order is nothing."""
    start, noise = belief, found.variance - jnp.sum(found.slope @ belief.covariance * found.slope, axis=1)
    for residual, own, slope, trust in zip(found.residual, noise, found.slope, trusts, strict=True):
        left = residual - slope @ (belief.mean - start.mean)
        belief = update(belief, Innovation(left, slope @ belief.covariance @ slope + own, slope), trust)
    return belief
