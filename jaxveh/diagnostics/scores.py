"""Scores of an estimate: errors, coverage of its bands, and the value of the bands."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_numbers
from jaxveh._core.host import on_host

NORMAL_HALF, NORMAL_95 = 0.6744897501960817, 1.959963984540054
"""Half the widths of the central 50 and 95 % intervals of a standard normal distribution."""


class Score(NamedTuple):
    """The score of an estimate against a reference, in the reference's unit.

    - `rmse`; `constant`: the mean of the error, such as a reference's misalignment, and `rmse_without_constant`: without it;
      `worst`: the largest absolute error.
    - `coverage_50`, `coverage_95`: shares of rows inside the central bands; `crps`: the continuous ranked probability score, the
      lower the better; `crps_constant`: that of the same mean with its best constant standard deviation. All are NaN
      for an estimate without standard deviations.
    - `rows`: the number of scored rows.
    """

    rmse: float
    constant: float
    rmse_without_constant: float
    worst: float
    coverage_50: float
    coverage_95: float
    crps: float
    crps_constant: float
    rows: int


@on_host
def score_band(
    reference: np.ndarray, mean: np.ndarray, std: np.ndarray | None = None, which: np.ndarray | None = None
) -> Score:
    """Score `mean` and `std` (T,) against a `reference` (T,), over its finite rows, and of those only the rows in `which` (T,).

    **Raises** `InputError` if no row is left.
    """
    for name, one in (("reference", reference), ("mean", mean), *((("std", std),) if std is not None else ())):
        check_numbers(f"score_band: {name}", one)
    known = np.isfinite(reference) if which is None else np.isfinite(reference) & which
    if not known.any():
        raise InputError(
            "score_band: the reference is NaN in every row that counts; there is nothing to score against."
        )
    error = (np.asarray(mean) - reference)[known]
    constant = float(np.mean(error))
    rms = lambda values: float(np.sqrt(np.mean(values**2)))
    without = rms(error - constant)
    inside_50 = inside_95 = crps = crps_constant = math.nan
    if std is not None:
        width = np.maximum(np.asarray(std)[known], 1e-300)
        away = np.abs(error) / width
        inside_50, inside_95 = (float(np.mean(away <= half)) for half in (NORMAL_HALF, NORMAL_95))
        crps, crps_constant = float(np.mean(width * _crps(away))), _crps_of_best_constant(error)
    return Score(
        rmse=rms(error), constant=constant, rmse_without_constant=without, worst=float(np.max(np.abs(error))),
        coverage_50=inside_50, coverage_95=inside_95, crps=crps, crps_constant=crps_constant, rows=int(known.sum()),
    )  # fmt: skip


def _crps(away: np.ndarray) -> np.ndarray:
    """Return the CRPS of a standard normal distribution at a distance from its mean.

    T. Gneiting and A. E. Raftery, J. Am. Stat. Assoc. 102 (2007), eq. 21.
    """
    density = np.exp(-0.5 * away**2) / math.sqrt(2 * math.pi)
    below = 0.5 * (1 + _erf(away / math.sqrt(2)))
    return away * (2 * below - 1) + 2 * density - 1 / math.sqrt(math.pi)


_erf = np.vectorize(math.erf, otypes=[float])


def _crps_of_best_constant(error: np.ndarray) -> float:
    """Return the lowest CRPS of a constant standard deviation, between a twentieth of and twice the errors' root mean square."""
    size = float(np.sqrt(np.mean(error**2)))
    if size == 0:
        return 0.0
    widths = size * np.geomspace(0.05, 2.0, 30)
    # Quantiles of the errors suffice: the score is an integral over their distribution.
    some = np.quantile(np.abs(error), (np.arange(500) + 0.5) / 500)
    return float(min(np.mean(width * _crps(some / width)) for width in widths))
