"""Rules of JAX's primitives for arrays whose last axis is the batch (`batch_last`): (..., size) instead of (...)."""

from __future__ import annotations

import dataclasses
import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jaxveh.numerics.fences import fence

MOST_TERMS = 64
"""The largest number of terms of a sum that is written out, one after the other, so that XLA's loops run along the batch."""


@dataclasses.dataclass(frozen=True, eq=False)
class Last:
    """A value for each member of a batch: `array` (..., size)."""

    array: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Product:
    """A product (..., size) that is used only by a sum, which multiplies its terms; it is never stored."""

    factors: tuple[Array, Array]


def wide(value: Any, shape: tuple[int, ...], size: int) -> Array:
    """A value, per member of the batch or the same for all, as (*shape, size); a scalar is broadcast to all places."""
    array = value.array if isinstance(value, Last) else jnp.asarray(value)[..., None]
    return jnp.broadcast_to(array, (*shape, size))


def pieces(array: Array, axes: Sequence[int]) -> list[Array]:
    """The parts of the array at each place along `axes`, without these axes; the last axis varies fastest."""
    found = []
    for place in np.ndindex(*(array.shape[axis] for axis in axes)):
        start, end = [0] * array.ndim, list(array.shape)
        for axis, k in zip(axes, place, strict=True):
            start[axis], end[axis] = k, k + 1
        found.append(lax.squeeze(lax.slice(array, start, end), tuple(axes)))
    return found


def reduction(combine: Callable, axes: tuple[int, ...], operand: Array | Product) -> Array | None:
    """A reduction, from the first term to the last; None if there are no terms or too many."""
    first = operand.factors[0] if isinstance(operand, Product) else operand
    if not 0 < math.prod(first.shape[axis] for axis in axes) <= MOST_TERMS:
        return None
    if isinstance(operand, Product):
        a, b = (pieces(one, axes) for one in operand.factors)
        return fence(functools.reduce(combine, map(operator.mul, a, b)), firm=True)
    return fence(functools.reduce(combine, pieces(operand, axes)), firm=True)


def inner_products(params: dict[str, Any], a: Array, b: Array) -> Array | None:
    """A `dot_general` term by term; None if it has batch axes of its own or too many terms."""
    (axes_a, axes_b), (batch, _) = params["dimension_numbers"]
    if batch or not 0 < math.prod(a.shape[axis] for axis in axes_a) <= MOST_TERMS:
        return None
    others = b.ndim - 1 - len(axes_b)
    beside = lambda piece: piece.reshape(*piece.shape[:-1], *[1] * others, piece.shape[-1])
    terms = [beside(x) * y for x, y in zip(pieces(a, axes_a), pieces(b, axes_b), strict=True)]
    return fence(functools.reduce(operator.add, terms), firm=True)


def cholesky(matrix: Array) -> Array:
    """The lower factors (n, n, size) of matrices, of which the lower triangle is read; NaN from the first pivot that is
    not positive.

    It is a loop: written out, the factors for 11 states take 30 instead of 110 ns, but half a second to compile each time.
    """
    rows = jnp.arange(len(matrix))[:, None]

    def step(j, carry):
        rest, factor = carry
        column = lax.dynamic_index_in_dim(rest, j, 1, keepdims=False)
        pivot = lax.dynamic_index_in_dim(column, j, 0)
        inverse = fence(1 / jnp.sqrt(jnp.where(pivot > 0, pivot, jnp.nan)), firm=True)
        column = fence(jnp.where(rows >= j, column * inverse, 0), firm=True)
        return rest - column[:, None] * column[None], lax.dynamic_update_index_in_dim(factor, column, j, 1)

    return lax.fori_loop(0, len(matrix), step, (matrix, jnp.zeros_like(matrix)))[1]


def triangular_solve(params: dict[str, Any], factor: Array, b: Array) -> Array:
    """The solutions (n, k, size), or (k, n, size) for a factor on the right, row by row."""
    lower, transposed = params["lower"], params["transpose_a"]
    if not params["left_side"]:
        b, transposed = jnp.swapaxes(b, 0, 1), not transposed
    if transposed:
        factor, lower = jnp.swapaxes(factor, 0, 1), not lower
    x: dict[int, Array] = {}
    for i in range(len(b)) if lower else reversed(range(len(b))):
        rest = b[i]
        for j, known in x.items():
            rest = rest - factor[i, j] * known
        x[i] = fence(rest if params["unit_diagonal"] else rest / factor[i, i], firm=True)
    found = jnp.stack([x[i] for i in range(len(b))])
    return found if params["left_side"] else jnp.swapaxes(found, 0, 1)


def gather(params: dict[str, Any], operand: Array, indices: Any, shape: tuple[int, ...]) -> Array:
    """A gather with the same `indices` for the whole batch; the result has the shape (*shape, size)."""
    numbers = params["dimension_numbers"]
    numbers = numbers._replace(offset_dims=(*numbers.offset_dims, len(shape)))
    sizes = (*params["slice_sizes"], operand.shape[-1])
    how = dict(params, dimension_numbers=numbers, slice_sizes=sizes)
    return lax.gather_p.bind(operand, indices, **how)


def _broadcast(params, operands, out):
    (x,), shape = operands, out[0].shape
    return lax.broadcast_in_dim(x, (*shape, x.shape[-1]), (*params["broadcast_dimensions"], len(shape)))


def _reshape(params, operands, out):
    return operands[0].reshape(*out[0].shape, operands[0].shape[-1])


def _slice(params, operands, out):
    (x,), steps = operands, params["strides"]
    ends = (*params["limit_indices"], x.shape[-1])
    return lax.slice(x, (*params["start_indices"], 0), ends, None if steps is None else (*steps, 1))


def _split(params, operands, out):
    ends = np.cumsum(params["sizes"])
    return [
        lax.slice_in_dim(operands[0], end - length, end, axis=params["axis"])
        for end, length in zip(ends, params["sizes"], strict=True)
    ]


MOVES: dict[str, Callable] = {
    "broadcast_in_dim": _broadcast,
    "concatenate": lambda params, operands, out: lax.concatenate(operands, params["dimension"]),
    "expand_dims": _reshape,
    "reshape": _reshape,
    "rev": lambda params, operands, out: lax.rev(operands[0], params["dimensions"]),
    "slice": _slice,
    "split": _split,
    "squeeze": _reshape,
    "stack": lambda params, operands, out: jnp.stack(operands, params["axis"]),
    "transpose": lambda params, operands, out: lax.transpose(
        operands[0], (*params["permutation"], len(params["permutation"]))
    ),
    "unstack": lambda params, operands, out: pieces(operands[0], (params["axis"],)),
}
"""Primitives that move numbers without computing."""


def _of_matrices(function: Callable, operands: Sequence[Array]) -> Array:
    """A function of matrices (n, k, size), applied along further leading axes."""
    for _ in range(operands[0].ndim - 3):
        function = jax.vmap(function)
    return function(*operands)


ALGEBRA: dict[str, Callable] = {
    "cholesky": lambda params, operands, out: _of_matrices(cholesky, operands),
    "dot_general": lambda params, operands, out: inner_products(params, *operands),
    "triangular_solve": lambda params, operands, out: _of_matrices(
        functools.partial(triangular_solve, params), operands
    ),
}
"""Primitives of matrices; where a rule gives None, `jax.vmap` is used."""
