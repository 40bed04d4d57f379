"""Roots of elementwise functions of one unknown, differentiable by the implicit function theorem."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp

_CORRECTIONS = 2
"""The number of Newton steps from a root without derivatives: if derivatives up to order k are right, a step makes them
right up to order 2 k + 1."""


def secant(function: Callable, arguments, x_0, x_1, tolerance, steps: int = 17):
    """`x` with `|function(x, arguments)| <= tolerance`, elementwise, by the secant method from two initial guesses.

    `function` maps an array and a tree of arrays to an array of the guesses' shape, elementwise. An element stops when
    it is within `tolerance`, and all stop after `steps`. Derivatives up to the third are those of the root: the first
    is `-(df / darguments) / (df / dx)`.
    """

    def step(carry):
        k, x_0, y_0, x_1, y_1, x, going = carry
        slope = y_1 - y_0
        tried = x_1 - (x_1 - x_0) / jnp.where(slope == 0, jnp.ones_like(slope), slope) * y_1
        x = jnp.where(going & (slope != 0), tried, x)
        y = fixed(x)
        better = jnp.abs(y_1) < jnp.abs(y_0)
        going = going & (jnp.abs(y) > tolerance)
        return k + 1, jnp.where(better, x_1, x_0), jnp.where(better, y_1, y_0), x, y, x, going

    held = jax.lax.stop_gradient(arguments)
    fixed = lambda x: function(x, held)
    x_0, x_1, tolerance = jax.lax.stop_gradient((x_0, x_1, tolerance))
    first = (0, x_0, fixed(x_0), x_1, fixed(x_1), x_1, jnp.ones(jnp.shape(x_1), bool))
    root = jax.lax.while_loop(lambda carry: jnp.any(carry[-1]) & (carry[0] < steps), step, first)[5]
    root = jax.lax.stop_gradient(root)
    for _ in range(_CORRECTIONS):
        value, slope = jax.jvp(lambda x: function(x, arguments), (root,), (jnp.ones_like(root),))
        # Its value is zero: it has derivatives only.
        moved = value - jax.lax.stop_gradient(value)
        root = root - moved / jnp.where(slope == 0, jnp.ones_like(slope), slope)
    return root
