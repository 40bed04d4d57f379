"""Rows that have the same time stamp and do not contradict one another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def without_repeats(
    time: np.ndarray, values: Mapping[str, np.ndarray], counts: str | None = None
) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Return rows (n,) with the same time stamp as one row, of what any of them has; where a column has two values at one time,
    the one that `counts`: `first` or `last`, or None as the whole answer.

    Loggers write a row for each device at one instant, or a row again.
    """
    first = np.flatnonzero(np.diff(time, prepend=-np.inf) != 0)
    joined = {}
    for name, column in values.items():
        finite = np.isfinite(column)
        least = np.minimum.reduceat(np.where(finite, column, np.inf), first)
        most = np.maximum.reduceat(np.where(finite, column, -np.inf), first)
        if counts is None and np.any(least < most):
            return None
        joined[name] = np.where(np.isfinite(least), least, np.nan) if counts is None else _one(column, first, counts)
    return time[first], joined


def _one(column: np.ndarray, first: np.ndarray, counts: str) -> np.ndarray:
    """Return the first or last known value of a column (n,) in each stretch that begins at the rows `first`; NaN for none."""
    rows, known = np.arange(column.size), np.isfinite(column)
    if counts == "last":
        row = np.maximum.reduceat(np.where(known, rows, -1), first)
    else:
        row = np.minimum.reduceat(np.where(known, rows, column.size), first)
    there = (row >= 0) & (row < column.size)
    return np.where(there, column[np.where(there, row, 0)], np.nan)
