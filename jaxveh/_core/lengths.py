"""Lengths that many logs share: a program that is compiled for one of them serves all logs that are a little shorter."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

LEAST = 128
"""Rows of the shortest of these lengths."""


def common_length(rows: int) -> int:
    """The next of the lengths 4, 5, 6 and 7 times a power of two, from `LEAST` on, that holds so many `rows`: at most a quarter
    more, and four programs serve all logs between a power of two and the next."""
    step = (1 << (max(rows, LEAST) - 1).bit_length()) // 8
    return -(-max(rows, LEAST) // step) * step


def lengthen(tree: Any, length: int) -> Any:
    """The (T, ...) leaves of a tree, none of them traced, with copies of their last row up to a `length`; nothing is compiled."""

    def longer(leaf):
        values = np.asarray(leaf)
        return jax.device_put(np.concatenate([values, np.repeat(values[-1:], length - len(values), axis=0)]))

    return jax.tree.map(longer, tree)


def lengthen_time(time: Any, length: int) -> Any:
    """The times (T,), not traced, that go on to a `length` by the last step, of one second if there is no other row."""
    known = np.asarray(time)
    step = known[-1] - known[-2] if len(known) > 1 else known.dtype.type(1.0)
    with np.errstate(over="ignore"):  # nobody reads these times
        more = known[-1] + step * np.arange(1, length - len(known) + 1, dtype=known.dtype)
    return jax.device_put(np.concatenate([known, more]))


def shorten(tree: Any, rows: int) -> Any:
    """The first `rows` of the (T, ...) leaves of a tree, on their devices; nothing is compiled. Inside a transformation they are
    traced, even if nothing of what they were computed from is."""

    def shorter(leaf):
        if isinstance(leaf, jax.core.Tracer):
            return leaf[:rows]
        return jax.device_put(np.asarray(leaf)[:rows], leaf.sharding if isinstance(leaf, jax.Array) else None)

    return jax.tree.map(shorter, tree)
