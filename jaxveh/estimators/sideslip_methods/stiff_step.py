"""A stable integration step for stiff equations with a few states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

GAMMA = 1.0 - 0.5**0.5
"""Coefficient of the method that makes it L-stable: a fast mode decays within one long step, as it does in the equations."""


LONGEST = 0.2
"""s: longest step. By then the past is forgotten, and over a longer step the slope at its start does not represent a tyre's
curve."""


class StiffStep(eqx.Module):
    """A transition by one step of ROS2, a linearly implicit L-stable method of second order (J. Verwer, E. Spee, J. Blom &
    W. Hundsdorfer, SIAM J. Sci. Comput. 20, 1999), with inputs held.

        (I - g h J) k1 = f(x),    (I - g h J) k2 = f(x + h k1) - 2 k1,    x + h (3 k1 + k2) / 2

    The poles of lateral motion are proportional to one over the speed, 80 1/s and more at a crawl, and logs have steps of 0.1 s,
    and gaps. A step longer than `LONGEST` is cut to it. `derivatives(system, t, x, u)` returns a NamedTuple like x, of scalars,
    or of arrays for a batch of states.
    """

    derivatives: Callable = eqx.field(static=True)

    def __call__(self, system: Any, t0: Any, t1: Any, x: Any, u: Any) -> Any:
        h, kind, values = jnp.minimum(t1 - t0, LONGEST), type(x), tuple(x)
        n, f = len(values), lambda *at: tuple(self.derivatives(system, t0, kind(*at), u))
        rates, push = jax.linearize(f, *values)
        # All columns of J at once: one program per column would multiply the compile time.
        along = [jnp.stack([jnp.full_like(v, float(k == i)) for i in range(n)]) for k, v in enumerate(values)]
        slopes = jax.vmap(push)(*along)
        matrix = [[float(i == j) - GAMMA * h * slopes[i][j] for j in range(n)] for i in range(n)]
        k1 = solve(matrix, list(rates))
        there = f(*[v + h * k for v, k in zip(values, k1, strict=True)])
        k2 = solve(matrix, [r - 2.0 * k for r, k in zip(there, k1, strict=True)])
        return kind(*[v + 0.5 * h * (3.0 * a + b) for v, a, b in zip(values, k1, k2, strict=True)])


def solve(matrix: list[list[Any]], right: list[Any]) -> list[Any]:
    """The solution x of A x = b by elimination without pivoting; entries are scalars, or arrays of a batch."""
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
