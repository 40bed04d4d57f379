"""The delay of an estimate."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import check_numbers
from jaxveh._core.host import on_host

LONGEST = 2.0
"""Largest delay that is searched for, s."""

LIVELY = 1e-9
"""A truth whose standard deviation is less than this share of its size is constant, so that a delay has no meaning."""

FEWEST = 10
"""Least number of rows for a comparison."""


@on_host
def delay(time: np.ndarray, mean: np.ndarray, truth: np.ndarray, *, longest: float = LONGEST) -> float:
    """Return the delay of `mean` behind `truth` (T,) along `time` (s), in s; it is negative if the estimate is early.

    It is the shift of the truth that minimises the mean square difference from the estimate, without the constant error. Both
    are interpolated at even steps. The result is NaN if fewer than ten rows are finite, the truth is constant, or there is no
    minimum within shifts of up to `longest` (s).
    """
    for name, one in (("time", time), ("mean", mean), ("truth", truth)):
        check_numbers(f"delay: {name}", one)
    time, mean, truth = (np.asarray(one, float) for one in (time, mean, truth))
    there = np.isfinite(mean) & np.isfinite(truth)
    if there.sum() < FEWEST:
        return math.nan
    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(round((time[-1] - time[0]) / step) + 1)
    read = lambda values: np.interp(even, time[there], values[there])
    inside = np.interp(even, time, there.astype(float)) > 0.999
    count = max(round(min(longest, 0.25 * (time[-1] - time[0])) / step), 1)
    return float(step * _compiled(read(mean), read(truth), inside, count))


def delay_of_rows(mean, truth, there, most: int):
    """Return the delay in rows of even steps, traced.

    It uses the rows in `there` (T,), and shifts of up to `most` rows either way. A parabola through the three nearest shifts
    interpolates between rows.
    """
    rows = jnp.arange(truth.shape[0])
    there = there & (rows >= most) & (rows < truth.shape[0] - most)
    count = jnp.sum(there).astype(mean.dtype)
    mean_of = lambda values: jnp.sum(jnp.where(there, values, 0.0)) / count
    size, mean, truth = numerics.largest(jnp.abs(truth)), mean - mean_of(mean), truth - mean_of(truth)

    def left(shift):
        error = mean - jnp.roll(truth, shift)
        return mean_of(error**2) - mean_of(error) ** 2

    shifts = jnp.arange(-most, most + 1)
    far = jax.lax.map(left, shifts)
    best = jnp.clip(jnp.argmin(far), 1, 2 * most - 1)
    before, here, after = far[best - 1], far[best], far[best + 1]
    curve = before - 2.0 * here + after
    bent = curve > 0.0
    between = jnp.where(bent, 0.5 * (before - after) / numerics.or_one(curve, bent), 0.0)
    found = shifts[best].astype(mean.dtype) + between
    moves = jnp.sqrt(mean_of(truth**2)) > max(LIVELY, 100.0 * float(jnp.finfo(mean.dtype).eps)) * size
    nearest = (here <= before) & (here <= after)
    return jnp.where((count >= FEWEST) & moves & nearest, found, jnp.nan)


_compiled = jax.jit(delay_of_rows, static_argnums=3)
