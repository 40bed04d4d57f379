"""Passes forward and back over many rows, in pieces: what the way back needs is in memory for one piece at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

PIECE = 20_000
"""The largest number of rows of a piece."""


class Piece(NamedTuple):
    """A piece of `rows`, with (n, ...) leaves, their `time` (n,), and where they are `there` (n,): the others only fill up the
    last piece, as copies of the last row, each a step later than it, and what was not to be counted."""

    time: Any
    rows: Any
    there: Any


def pieces_of(count: int) -> int:
    """The number of pieces into which so many rows are cut."""
    return max(1, -(-count // PIECE))


def there_and_back(
    ahead: Callable[[Any, Piece], Any],
    back: Callable[[Any, Any, Piece], tuple[Any, Any]],
    start: Any,
    turn: Callable[[Any], Any],
    time: Any,
    rows: Any,
    count: Any = None,
) -> tuple[Any, Any]:
    """A pass forward over `rows`, (T, ...) leaves with T >= 2, at `time` (T,), and one back, in `pieces_of` them. `count`: how
    many of the rows, from the first on, are there, if not all.

    Forward, `ahead(carry, piece)` is the carry after a piece, `start` the one before the first. Back, the pieces come in reverse:
    `back(later, carry, piece)` is what the piece before needs, and what is shown of the rows of this piece, (n, ...) leaves, from
    the `carry` before the piece; `later` of the last piece is `turn(carry)` of the carry after it. Neither may count rows that
    are not there.

    Returns the last carry, and what is shown of all rows, (T, ...) leaves.
    """
    # In a gradient, too, only the first carry of a piece is kept.
    scan = lambda body, *values, **how: jax.lax.scan(jax.checkpoint(body, prevent_cse=False), *values, **how)
    pieces = _cut(time, rows, len(time) if count is None else count)
    last, starts = scan(lambda carry, piece: (ahead(carry, piece), carry), start, pieces)
    _, shown = scan(lambda later, given: back(later, *given), turn(last), (starts, pieces), reverse=True)
    return last, jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[: len(time)], shown)


def _cut(time: Any, rows: Any, count: Any) -> Piece:
    """The rows, of which the first `count` are there, in pieces of one length: leaves (pieces, length, ...)."""
    given, pieces = len(time), pieces_of(len(time))
    length = -(-given // pieces)
    places = jnp.arange(pieces * length).reshape(pieces, length)

    def cut(leaf):
        filled = jnp.concatenate([leaf, jnp.repeat(leaf[-1:], pieces * length - given, axis=0)])
        return filled.reshape(pieces, length, *leaf.shape[1:])

    # A step of no length may have no slope.
    times = jnp.where(places < given, cut(time), 2 * time[-1] - time[-2])
    return Piece(times, jax.tree.map(cut, rows), places < count)
