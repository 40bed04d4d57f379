"""Two estimators on the same seeds: ratios, wins, and their confidence intervals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check, check_numbers, check_whole
from jaxveh._core.host import on_host

RESAMPLED = 2000
"""Bootstrap draws of the seeds."""


class ConfidenceInterval(NamedTuple):
    """A `value` and the bootstrap interval from `low` to `high`."""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


class Comparison(NamedTuple):
    """Positive numbers (errors) of a compared with those of b on the same seeds.

    `ratio`: the median over seeds of a / b, with its interval; `of_medians`: the ratio of both medians, with its interval;
    `wins`: the share of seeds in which a is smaller; a tie is half a win. A run that is not finite has lost.
    """

    ratio: ConfidenceInterval
    of_medians: ConfidenceInterval
    wins: np.ndarray


@on_host
def compare(a: np.ndarray, b: np.ndarray, *, axis: int = -1, level: float = 0.95) -> Comparison:
    """Compare errors `a` and `b` of the same shape, paired along `axis` (the seeds).

    Intervals are percentiles of the statistic over seeds drawn with replacement (B. Efron 1979); the draws are always the
    same.

    **Raises** `InputError` for different shapes, fewer than two seeds, or a negative value.
    """
    check("level", level, lambda p: (p > 0) & (p < 1), "above 0 and below 1")
    check_numbers("a", a)
    check_numbers("b", b)
    a, b = np.asarray(a, float), np.asarray(b, float)
    if a.ndim == 0:
        raise InputError("compare: a is one number: must be the errors of several seeds, at least two.")
    check_whole("axis", axis, -a.ndim, most=a.ndim - 1)
    if a.shape != b.shape:
        raise InputError(f"a has shape {a.shape}, b {b.shape}: must be the same seeds and points.")
    a, b = np.moveaxis(a, axis, -1), np.moveaxis(b, axis, -1)
    seeds = a.shape[-1]
    if seeds < 2:
        raise InputError(f"{seeds} seed: a comparison needs at least two.")
    if (a < 0).any() or (b < 0).any():
        raise InputError("a and b must not be negative: they are compared by ratios.")
    a, b = (np.where(np.isfinite(v), v, np.inf) for v in (a, b))
    ratios, wins = _ratios(a, b), np.where(a < b, 1.0, np.where(a == b, 0.5, 0.0)).mean(axis=-1)
    drawn = np.random.default_rng(0).integers(0, seeds, (RESAMPLED, seeds))
    return Comparison(
        ratio=_interval(_median(ratios), _median(ratios[..., drawn]), level),
        of_medians=_interval(
            _ratios(_median(a), _median(b)), _ratios(_median(a[..., drawn]), _median(b[..., drawn])), level
        ),
        wins=wins,
    )


def _ratios(a, b):
    """a / b; infinite over infinite (both have lost) and zero over zero are a tie."""
    tie = a == b
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(tie, 1.0, a / np.where(tie, 1.0, b))


def _median(values):
    """The median along the last axis, also of infinities."""
    ordered = np.sort(values, axis=-1)
    n = ordered.shape[-1]
    low, high = ordered[..., (n - 1) // 2], ordered[..., n // 2]
    return np.where(low == high, low, 0.5 * (low + high))


def _interval(value, draws, level) -> ConfidenceInterval:
    low, high = (np.quantile(draws, q, axis=-1, method="nearest") for q in (0.5 * (1 - level), 0.5 * (1 + level)))
    return ConfidenceInterval(value, low, high)
