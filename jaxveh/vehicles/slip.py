"""The slip of a wheel from the velocity of its contact point, smooth through standstill."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check_numbers, check_positive


def regularised_speed(v: jax.Array, crawl: float) -> jax.Array:
    """|v|, exact from the `crawl` speed (m/s) upwards; below it `crawl (3 + 6 s^2 - s^4) / 8` with `s = v / crawl`.

    It is even, twice continuously differentiable and never below `3 crawl / 8`. One can therefore divide by it, and the poles
    of lateral motion, which grow with 1 / |v|, remain slow enough for an explicit solver.

    **Raises** `InputError` for a `v` that is no number or array of them, and a `crawl` that is not positive.
    """
    v = _numbers("v", v)
    check_positive("crawl", crawl, "m/s")
    # Bounded before the polynomial, so that the unused branch cannot overflow.
    square = jnp.minimum(jnp.square(v * (1.0 / crawl)), 1.0)
    return jnp.where(jnp.abs(v) >= crawl, jnp.abs(v), (crawl / 8.0) * (3.0 + square * (6.0 - square)))


def slip_angle(v_x: jax.Array, v_y: jax.Array, crawl: float) -> jax.Array:
    """The slip angle, rad, of a wheel whose contact point moves with `v_x`, `v_y` (m/s) in the wheel's axes.

    `-atan2(v_y, |v_x|)`: a wheel that slides to the left (v_y > 0) has a negative slip angle and gets a force to the right, in
    forward and in backward travel. |v_x| is regularised below the `crawl` speed (m/s).

    **Raises** `InputError` as `regularised_speed` does.
    """
    v_x, v_y = _numbers("v_x", v_x), _numbers("v_y", v_y)
    return -numerics.arctan2(v_y, regularised_speed(v_x, crawl))


def _numbers(name: str, value):
    """A number or an array as it is, and a list as an array."""
    check_numbers(name, value)
    return jnp.asarray(value, float) if isinstance(value, list | tuple) else value
