"""How much noisier a log is than a method assumes, learned row by row: a rough road, a loose sensor, a cheap receiver."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

OUTLIER = 9.0
"""Largest squared innovation over its predicted variance that counts: that of three standard deviations."""

FIRST = 0.2
"""s: for how long the first misfit counts as learnt."""

CAUTION = 4.0
"""The misfit before the first row: what is believed of a noisy log before its noise is known would stay believed."""

LEARN_TIME = 20.0
"""s: memory of a misfit."""

ROUGH_TIME = 2.0
"""s: memory of the noise of an input."""


class Misfit(NamedTuple):
    """By how much the variances of a method's measurements exceed those that it assumes, `times` (m,), at least 1; from how many
    seconds this was learnt, `seconds` (m,), and the time since each was measured, `since` (m,), s."""

    times: Any
    seconds: Any
    since: Any


def no_misfit(count: int, like: Any, first: float = CAUTION, seconds: float = FIRST) -> Misfit:
    """The misfit of `count` measurements before the first row, in the dtype of `like`: `first`, as if learnt from so many
    `seconds`."""
    ones = jnp.ones((count,), jnp.result_type(like))
    return Misfit(first * ones, seconds * ones, jnp.zeros_like(ones))


def learn_misfit(misfit: Misfit, squares: Any, dt: Any, learn_time: Any = LEARN_TIME) -> Misfit:
    """The misfit after a row, `dt` (s) after the last, with these squared innovations over their predicted variances (m,), NaN
    where nothing was measured (R. Mehra 1970).

    It is learnt at once in the first seconds, then with a memory of `learn_time` (s), and it is never below 1: small innovations
    in gentle driving do not show that the model holds near the limit.
    """
    here = ~jnp.isnan(squares)
    since = misfit.since + dt
    seconds = jnp.minimum(misfit.seconds + since, learn_time)
    news = jnp.minimum(jnp.where(here, squares, 1.0), OUTLIER) - 1.0
    times = jnp.maximum(misfit.times * (1.0 + jnp.minimum(since / seconds, 1.0) * news), 1.0)
    after = Misfit(times, seconds, jnp.zeros_like(since))
    return jax.tree.map(lambda new, old: jnp.where(here, new, old), after, misfit._replace(since=since))


class Roughness(NamedTuple):
    """The `variance` of the white noise in a channel, and its last two measurements, `last` and `before`."""

    variance: Any
    last: Any
    before: Any


def no_roughness(value: Any) -> Roughness:
    """The roughness after the first measurement, NaN where missing."""
    value = jnp.where(jnp.isnan(value), 0.0, value)
    return Roughness(jnp.zeros_like(value), value, value)


def learn_roughness(rough: Roughness, value: Any, dt: Any) -> Roughness:
    """The roughness after another measurement, NaN where missing, `dt` (s) after the last."""
    here = ~jnp.isnan(value)
    # Without this replacement the derivative would be NaN even where its result is not used.
    value = jnp.where(here, value, rough.last)
    share = 1.0 - jnp.exp(-dt / ROUGH_TIME)
    news = jnp.square(white_part(value, rough.last, rough.before))
    after = Roughness(rough.variance + share * (news - rough.variance), value, rough.last)
    return jax.tree.map(lambda new, old: jnp.where(here, new, old), after, rough)


def white_part(value: Any, last: Any, before: Any) -> Any:
    """The second difference of three measurements, scaled to the variance of their white noise: the motion of a car hardly
    contributes to it at the rate of its sensors."""
    return (value - 2.0 * last + before) / math.sqrt(6.0)
