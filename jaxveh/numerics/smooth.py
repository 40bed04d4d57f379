"""Steps, ramps and limits with smooth edges, exact outside the edges."""

from __future__ import annotations

import jax
import jax.numpy as jnp


def smooth_step(s: jax.Array) -> jax.Array:
    """A step from 0 at s <= 0 to 1 at s >= 1, twice continuously differentiable: `10 s^3 - 15 s^4 + 6 s^5` in between."""
    s = jnp.clip(s, 0.0, 1.0)
    return s * s * s * (10.0 - s * (15.0 - 6.0 * s))


def smooth_bump(s: jax.Array) -> jax.Array:
    """The slope of `smooth_step`: `30 s^2 (1 - s)^2` in between, 0 outside; its integral is 1."""
    s = jnp.clip(s, 0.0, 1.0)
    return 30.0 * jnp.square(s * (1.0 - s))


def smooth_ramp(x: jax.Array, width: jax.Array | float) -> jax.Array:
    """The integral of a `smooth_step` from -`width` to `width` (positive): 0 below -`width`, exactly x above `width`.

    Three times continuously differentiable, never negative, and `smooth_ramp(x) - smooth_ramp(-x) = x`.
    """
    s = jnp.clip((x + width) / (2.0 * width), 0.0, 1.0)
    edge = 2.0 * width * s * s * s * s * (2.5 - s * (3.0 - s))
    return jnp.where(x >= width, x, edge)


def smooth_clip(x: jax.Array, low, high, width: jax.Array | float) -> jax.Array:
    """x limited to the range from `low` to `high`: exactly x, `low` or `high` at more than `width` from the two corners.

    Three times continuously differentiable; `width` is positive and at most half of `high - low`.
    """
    return x - smooth_ramp(x - high, width) + smooth_ramp(low - x, width)
