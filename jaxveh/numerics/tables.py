"""Tables over an axis, linear or smooth between their points, constant beyond the ends."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh.numerics.divisors import or_one


def interpolate_linear(x: jax.Array, points: jax.Array, values: jax.Array) -> jax.Array:
    """Linear interpolation between `points` (n,), rising, n >= 2, with `values` (n,); constant beyond. The result has the
    shape of x."""
    left, share, _ = _place(x, points)
    return values[left] + share * (values[left + 1] - values[left])


def interpolate_smooth(x: jax.Array, points: jax.Array, values: jax.Array) -> jax.Array:
    """Cubic interpolation between `points` (n,), rising, n >= 2, with `values` (n,); once continuously differentiable,
    constant beyond the ends.

    Between two points the result stays between their values (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5
    (1984)): the slope at an inner point is the weighted harmonic mean of the slopes on both sides, and zero at a peak.
    At the two ends it is zero, because the table is constant beyond.
    """
    left, share, step = _place(x, points)
    slopes = _slopes(points, values)
    rest = 1.0 - share
    along = share * share * (3.0 - 2.0 * share)
    bend = share * rest * step * (rest * slopes[left] - share * slopes[left + 1])
    return values[left] + along * (values[left + 1] - values[left]) + bend


def _place(x, points):
    """The index of the point to the left, the position of x between it and the next point (0 to 1), and their distance."""
    left = jnp.clip(jnp.searchsorted(points, x, side="right"), 1, points.shape[0] - 1) - 1
    step = points[left + 1] - points[left]
    share = (x - points[left]) / step
    # Unlike a clip, this has the full slope at the end points.
    return left, jnp.where(x < points[0], 0.0, jnp.where(x > points[-1], 1.0, share)), step


def _slopes(points, values):
    steps = jnp.diff(points)
    secants = jnp.diff(values) / steps
    before, after = secants[:-1], secants[1:]
    first, second = 2.0 * steps[1:] + steps[:-1], steps[1:] + 2.0 * steps[:-1]
    same = before * after > 0
    weighted = first / or_one(before, same) + second / or_one(after, same)
    inner = jnp.where(same, (first + second) / or_one(weighted, same), 0.0)
    zero = jnp.zeros((1,), values.dtype)
    return jnp.concatenate((zero, inner, zero))
