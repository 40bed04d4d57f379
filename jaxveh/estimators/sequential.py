"""A small extended Kalman filter that takes measurements one by one as they arrive, with noises that vary from row to row.

The Gaussian filters of `jaxveh.filters` use a `StateSpace`, whose process noise has one law for all rows. A road changes with
distance and not with time, so here the noise is given with every step. A step is a few products of small matrices.

`predict`, `implicit_step`, `innovation` and `update` work on vectors; `belief_of`, `move`, `correct`, `correct_by_each` and
`spread_of` on states with named fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.estimators.misfit import Misfit, learn_misfit


class Belief(NamedTuple):
    """Mean (n,) and covariance (n, n), in the order of the state's fields."""

    mean: Any
    covariance: Any


class Innovation(NamedTuple):
    """The innovation of one measurement: `residual`, its expected `variance`, and the slope (n,) of the expected value."""

    residual: Any
    variance: Any
    slope: Any


def predict(belief: Belief, transition: Callable[[Any], Any], noise: Any) -> Belief:
    """The belief after the `transition` of a mean (n,), with process noise of covariance `noise` (n, n)."""
    slopes = jax.jacfwd(transition)(belief.mean)
    covariance = numerics.symmetric(slopes @ belief.covariance @ slopes.T) + noise
    return Belief(transition(belief.mean), covariance)


def innovation(belief: Belief, expect: Callable[[Any], Any], value: Any, variance: Any) -> Innovation:
    """The innovation of `value`, measured with noise of `variance`, about `expect(mean)`; without effect where it is NaN."""
    expected, slope = jax.value_and_grad(expect)(belief.mean)
    there = ~jnp.isnan(value)
    residual = jnp.where(there, value, expected) - expected
    slope = jnp.where(there, slope, 0.0)
    return Innovation(residual, slope @ belief.covariance @ slope + variance, slope)


def update(belief: Belief, found: Innovation, trust: Any = 1.0) -> Belief:
    """The belief after an innovation whose expected variance is multiplied by `1 / trust`; a trust of 0 leaves it unchanged.

    The added variance is noise, so the gain is the Kalman gain times `trust`.
    """
    along = belief.covariance @ found.slope
    gain = trust * along / found.variance
    mean = belief.mean + gain * found.residual
    # Joseph's form. In float32 neither it nor the difference of two covariances stays positive where a sensor is ten thousand
    # times sharper than the belief; then this form is less wrong (least over largest eigenvalue -3e3 instead of -4e6).
    left = jnp.eye(mean.shape[0], dtype=mean.dtype) - jnp.outer(gain, found.slope)
    noise = (found.variance - trust * (found.slope @ along)) * jnp.outer(gain, along / found.variance)
    return Belief(mean, numerics.symmetric(left @ belief.covariance @ left.T + noise))


def innovations(belief: Belief, expect: Callable[[Any], Any], values: Any, variances: Any) -> Innovation:
    """The innovations of several measurements (m,) at once, whose noises are independent: fields (m,), slopes (m, n)."""
    expected, slopes = expect(belief.mean), jax.jacfwd(expect)(belief.mean)
    there = ~jnp.isnan(values)
    residuals = jnp.where(there, values, expected) - expected
    slopes = jnp.where(there[:, None], slopes, 0.0)
    return Innovation(residuals, jnp.sum(slopes @ belief.covariance * slopes, axis=1) + variances, slopes)


def update_by_each(belief: Belief, found: Innovation, trusts: Any) -> Belief:
    """The belief after `innovations`, applied one by one, each with its trust; about one point, so their order does not
    matter."""
    start, noise = belief, found.variance - jnp.sum(found.slope @ belief.covariance * found.slope, axis=1)
    for residual, own, slope, trust in zip(found.residual, noise, found.slope, trusts, strict=True):
        left = residual - slope @ (belief.mean - start.mean)
        belief = update(belief, Innovation(left, slope @ belief.covariance @ slope + own, slope), trust)
    return belief


def belief_of(state_type: Any, means: Mapping[str, Any], stds: Mapping[str, Any], like: Any) -> Belief:
    """Independent states of a NamedTuple `state_type` with these `means` and standard deviations `stds` by name (0 where not
    given), in the dtype of `like`."""
    dtype = jnp.result_type(like)
    mean = _vector(means, state_type, dtype)
    return Belief(mean, jnp.diag(jnp.square(_vector(stds, state_type, dtype))))


def move(belief: Belief, step: Callable[[Any], Any], variances: Mapping[str, Any], state_type: Any) -> Belief:
    """The belief after `step(state) -> state` with independent noise of these variances."""
    noise = jnp.diag(_vector(variances, state_type, belief.mean.dtype))
    return predict(belief, lambda vector: jnp.stack(step(state_type(*vector))), noise)


class Measurement(NamedTuple):
    """One measurement, with independent noise of this `variance`, where it is `here`.

    `error_of(state)`: the measurement less its prediction; finite wherever the belief is. `gate`: an error e of more than this
    many of its predicted standard deviations has the weight `(gate / |e|)^fall`, None: all have the same weight. With a
    `fall` of 1 (Huber) the correction stays the same beyond the gate, with more it falls. `repeats`: an error that lasts for so
    many rows has a `variance` of so many times its own, so that together they count once.
    """

    error_of: Callable[[Any], Any]
    variance: Any
    here: Any
    gate: Any = None
    fall: float = 1.0
    repeats: Any = 1.0


def correct(belief: Belief, measurement: Measurement, state_type: Any) -> Belief:
    """The belief after one measurement."""
    return _corrected(belief, measurement, measurement.variance, state_type)[0]


def correct_by_each(
    belief: Belief, measurements: Sequence[Measurement], misfit: Misfit, dt: Any, state_type: Any
) -> tuple[Belief, Misfit]:
    """The belief after one measurement after another, whose variances are multiplied by what the `misfit` has learnt until this
    row, `dt` (s) after the last; and the misfit after it."""
    squares = []
    for times, one in zip(misfit.times, measurements, strict=True):
        noise = times * one.variance
        belief, found = _corrected(belief, one, noise, state_type)
        # The variance of the innovation itself, of which several may be the same error.
        own = found.variance - noise * (1.0 - 1.0 / one.repeats)
        squares.append(jnp.where(one.here, jnp.square(found.residual) / own, jnp.nan))
    return belief, learn_misfit(misfit, jnp.stack(squares), dt)


def _corrected(belief: Belief, one: Measurement, noise: Any, state_type: Any) -> tuple[Belief, Innovation]:
    """The belief after a measurement with noise of this variance, and the innovation."""
    error, slope = jax.value_and_grad(lambda vector: one.error_of(state_type(*vector)))(belief.mean)
    found = Innovation(error, slope @ belief.covariance @ slope + noise, -slope)
    trust = jnp.ones_like(error)
    if one.gate is not None:
        trust = jnp.maximum(jnp.square(error) / (one.gate * one.gate * found.variance), 1.0) ** (-0.5 * one.fall)
    return update(belief, found, jnp.where(one.here, trust, 0.0)), found


def spread_of(belief: Belief, weights: Mapping[str, Any], state_type: Any) -> Any:
    """The standard deviation of a sum of states with `weights` by name, in a `belief`."""
    h = _vector(weights, state_type, belief.mean.dtype)
    return numerics.sqrt(jnp.maximum(h @ belief.covariance @ h, 0.0))


def implicit_step(rates: Callable[[Any], Any], x: Any, dt: Any) -> tuple[Any, Any]:
    """The change (2,) of the first two of the states x (n,), which have these `rates` (2,), and its slopes (2, n), in a linearly
    implicit trapezoidal step: stable however fast they are."""
    rate, slope = rates(x), jax.jacfwd(rates)(x)
    left = jnp.eye(2, dtype=x.dtype) - 0.5 * dt * slope[:, :2]
    determinant = left[0, 0] * left[1, 1] - left[0, 1] * left[1, 0]
    inverse = jnp.stack([jnp.stack([left[1, 1], -left[0, 1]]), jnp.stack([-left[1, 0], left[0, 0]])]) / determinant
    return dt * (inverse @ rate), dt * (inverse @ slope)


def _vector(values: Mapping[str, Any], state_type: Any, dtype: Any) -> Any:
    """The vector (n,) of the values by name, 0 where not given."""
    return jnp.stack([jnp.asarray(values.get(name, 0.0), dtype) for name in state_type._fields])
