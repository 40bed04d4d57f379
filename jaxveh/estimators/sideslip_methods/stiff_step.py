"""A step of stiff equations of a few states that stays stable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

GAMMA = 1.0 - 0.5**0.5
"""Of the method: with it what dies out in the equations dies out in one long step, too."""


LONGEST = 0.2
"""s: of a step. What was before is forgotten by then; over more a slope at its start says nothing of a tyre's curve."""


class StiffStep(eqx.Module):
    """A transition by one step of ROS2, a linearly implicit method of second order that is L-stable (J. Verwer, E. Spee,
    J. Blom & W. Hundsdorfer, SIAM J. Sci. Comput. 20, 1999), inputs held.

        (I - g h J) k1 = f(x),    (I - g h J) k2 = f(x + h k1) - 2 k1,    x + h (3 k1 + k2) / 2

    The poles of lateral motion go with one over the speed, 80 1/s and more where a car crawls, and logs have rows of 0.1 s and
    gaps; longer ones than `LONGEST` are cut to it. `derivatives(system, t, x, u)`: a NamedTuple of scalars as x, or of arrays
    for a batch of states.
    """

    derivatives: Callable = eqx.field(static=True)

    def __call__(self, system: Any, t0: Any, t1: Any, x: Any, u: Any) -> Any:
        h, kind, values = jnp.minimum(t1 - t0, LONGEST), type(x), tuple(x)
        n, f = len(values), lambda *at: tuple(self.derivatives(system, t0, kind(*at), u))
        rates, push = jax.linearize(f, *values)
        # All columns of J at once: a program a column would take as many times as long to compile.
        along = [jnp.stack([jnp.full_like(v, float(k == i)) for i in range(n)]) for k, v in enumerate(values)]
        slopes = jax.vmap(push)(*along)
        matrix = [[float(i == j) - GAMMA * h * slopes[i][j] for j in range(n)] for i in range(n)]
        k1 = solve(matrix, list(rates))
        there = f(*[v + h * k for v, k in zip(values, k1, strict=True)])
        k2 = solve(matrix, [r - 2.0 * k for r, k in zip(there, k1, strict=True)])
        return kind(*[v + 0.5 * h * (3.0 * a + b) for v, a, b in zip(values, k1, k2, strict=True)])


def solve(matrix: list[list[Any]], right: list[Any]) -> list[Any]:
    """x of A x = b with entries that are scalars or arrays of a batch, by elimination without pivots."""
    rows, n = [[*row, b] for row, b in zip(matrix, right, strict=True)], len(right)
    for i in range(n):
        for k in range(i + 1, n):
            share = rows[k][i] / rows[i][i]
            rows[k] = [a - share * b for a, b in zip(rows[k], rows[i], strict=True)]
    found: list[Any] = [None] * n
    for i in reversed(range(n)):
        left = rows[i][n] - sum((rows[i][j] * found[j] for j in range(i + 1, n)), 0.0)
        found[i] = left / rows[i][i]
    return found
