"""By how much an estimate comes late."""

from __future__ import annotations

import math

import numpy as np

LONGEST = 2.0
"""s: what follows later than that is not followed."""

LIVELY = 1e-9
"""A truth whose spread is less than this share of its size does not move, so that nothing can be late."""


def delay(time: np.ndarray, mean: np.ndarray, truth: np.ndarray, *, longest: float = LONGEST) -> float:
    """The delay of `mean` behind `truth` (T,) along `time` (s): by which the truth must be shifted to be nearest to the estimate
    in the mean square, less the constant error; s, negative where the estimate is early.

    Between rows by a parabola through the three nearest shifts. NaN where fewer than ten rows are finite, the truth does not
    move, or no shift of up to `longest` (s) is nearest.
    """
    time, mean, truth = (np.asarray(one, float) for one in (time, mean, truth))
    there = np.isfinite(mean) & np.isfinite(truth)
    if there.sum() < 10 or np.std(truth[there]) <= LIVELY * max(np.abs(truth[there]).max(), 1e-300):
        return math.nan
    step = float(np.median(np.diff(time)))
    count = round(min(longest, 0.25 * (time[-1] - time[0])) / step)
    shifts = step * np.arange(-count, count + 1)
    far = np.array([_error(time, mean, truth, there, shift) for shift in shifts])
    best = int(np.argmin(far))
    if best in (0, len(shifts) - 1):
        return math.nan
    before, here, after = far[best - 1 : best + 2]
    curve = before - 2.0 * here + after
    return float(shifts[best] + (0.5 * step * (before - after) / curve if curve > 0.0 else 0.0))


def _error(time, mean, truth, there, shift: float) -> float:
    """Mean square of what is left after the shift, over the rows whose truth lies inside the log whatever the shift."""
    known = there & (time - abs(shift) >= time[0]) & (time + abs(shift) <= time[-1])
    error = mean[known] - np.interp(time[known] - shift, time[np.isfinite(truth)], truth[np.isfinite(truth)])
    return float(np.var(error))
