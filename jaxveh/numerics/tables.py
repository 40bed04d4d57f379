"""Tables over an axis, linear or smooth between their points, held at the ends."""

from __future__ import annotations

import jax
import jax.numpy as jnp


def interpolate_linear(x: jax.Array, points: jax.Array, values: jax.Array) -> jax.Array:
    """Straight lines between `points` (n,), rising, n >= 2, with `values` (n,); held beyond. The shape of x."""
    left, share, _ = _place(x, points)
    return values[left] + share * (values[left + 1] - values[left])


def interpolate_smooth(x: jax.Array, points: jax.Array, values: jax.Array) -> jax.Array:
    """Cubics between `points` (n,), rising, n >= 2, with `values` (n,), once continuously differentiable; held beyond.

    Never beyond the two values it lies between (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984)):
    the slope at an inner point is the weighted harmonic mean of its neighbours' and zero at a peak; at the two ends it
    is zero, because the table is held there.
    """
    left, share, step = _place(x, points)
    slopes = _slopes(points, values)
    rest = 1.0 - share
    along = share * share * (3.0 - 2.0 * share)
    bend = share * rest * step * (rest * slopes[left] - share * slopes[left + 1])
    return values[left] + along * (values[left + 1] - values[left]) + bend


def _place(x, points):
    """The point to the left, how far x is on the way to the next (0 to 1), and how long the way is."""
    left = jnp.clip(jnp.searchsorted(points, x, side="right"), 1, points.shape[0] - 1) - 1
    step = points[left + 1] - points[left]
    share = (x - points[left]) / step
    # Unlike a clip this has the whole slope at the points themselves.
    return left, jnp.where(x < points[0], 0.0, jnp.where(x > points[-1], 1.0, share)), step


def _slopes(points, values):
    steps = jnp.diff(points)
    secants = jnp.diff(values) / steps
    before, after = secants[:-1], secants[1:]
    first, second = 2.0 * steps[1:] + steps[:-1], steps[1:] + 2.0 * steps[:-1]
    same = before * after > 0
    weighted = first / jnp.where(same, before, 1.0) + second / jnp.where(same, after, 1.0)
    inner = jnp.where(same, (first + second) / jnp.where(same, weighted, 1.0), 0.0)
    zero = jnp.zeros((1,), values.dtype)
    return jnp.concatenate((zero, inner, zero))
