"""Rows that have the same time stamp and do not contradict one another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def without_repeats(
    time: np.ndarray, values: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Return rows (n,) with the same time stamp as one row, of what any of them has; None if a column has two values at one time.

    Loggers write a row for each device at one instant, or a row again.
    """
    first = np.flatnonzero(np.diff(time, prepend=-np.inf) != 0)
    joined = {}
    for name, column in values.items():
        finite = np.isfinite(column)
        least = np.minimum.reduceat(np.where(finite, column, np.inf), first)
        most = np.maximum.reduceat(np.where(finite, column, -np.inf), first)
        if np.any(least < most):
            return None
        joined[name] = np.where(np.isfinite(least), least, np.nan)
    return time[first], joined
