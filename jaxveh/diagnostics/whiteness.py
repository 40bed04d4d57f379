"""The whiteness of innovations: correlation between rows is a part that the filter could have predicted."""

from __future__ import annotations

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check, is_whole
from jaxveh._core.host import on_host
from jaxveh.diagnostics.chi_squared import chi_squared_tails
from jaxveh.diagnostics.innovations import check_filtered, whitened_innovations


class Whiteness(NamedTuple):
    """Correlations of innovations between rows, and the test that all are zero.

    `channels`: their names (m,); `lags` (L,) in rows; `correlations` (L, m, m): of channel i with channel j a lag of rows later;
    `band` (L, m, m): the bound of each on either side of zero, which holds with probability `confidence` for white innovations.
    Both are NaN if no pair of rows has both channels. `statistic`: chi-squared with `degrees_of_freedom` for white innovations;
    `p_value`: the probability of at least that value.
    """

    channels: tuple[str, ...]
    lags: np.ndarray
    correlations: np.ndarray
    band: np.ndarray
    statistic: float
    degrees_of_freedom: int
    p_value: float
    confidence: float

    @property
    def white(self) -> bool:
        """Whether the test does not reject whiteness at `confidence`."""
        return self.p_value >= 1 - self.confidence

    @property
    def share_inside(self) -> float:
        """The share of correlations within their bands; the expected share is about `confidence`."""
        known = np.isfinite(self.correlations)
        return float(np.mean(np.abs(self.correlations[known]) <= self.band[known]))


@on_host
def whiteness(estimate: Any, lags: int = 20, confidence: float = 0.95, skip: int = 0) -> Whiteness:
    """Return the portmanteau test of a filter's innovations, and their correlations with bands.

    **Arguments**: `estimate`: any object with an `info` with (T,) leaves, or (R, T) for independent runs; `lags` in rows, at
    least 1; `skip`: rows left out at the start.

    With innovations w over their predicted standard deviations, and n_l(i, j) pairs of rows l apart that have channel i in the
    first row and j in the second,

        r_l(i, j) = sum w_i(k) w_j(k + l) / n_l / (s_i s_j),    s_i^2 = mean of w_i^2
        statistic = (N + 2) / N * sum n_l r_l^2,    N rows

    (G. Ljung & G. Box 1978; J. Hosking 1980 for several channels; D. Stoffer & C. Toloi 1992 for missing rows; the band
    1 / sqrt(n_l) as in Bar-Shalom, Li & Kirubarajan 2001, sec. 5.4.2). Means are not subtracted: innovations with a bias are not
    white. A common wrong factor in all covariances changes neither the gain nor the whiteness: `nis` detects that.

    **Raises** `InputError` for lags out of range, or if the innovations cannot be normalised.
    """
    check_filtered("whiteness", estimate)
    check("confidence", confidence, lambda p: (p > 0) & (p < 1), "above 0 and below 1")
    white, here = whitened_innovations(estimate.info, skip)
    runs, rows, _ = white.shape
    if not is_whole(lags) or not 1 <= lags < rows:
        raise InputError(f"lags = {lags}: must be a whole number from 1 to {rows - 1}, for {rows} rows.")
    count = here.sum(axis=(0, 1))
    scale = np.sqrt(np.sum(white**2, axis=(0, 1)) / np.maximum(count, 1))
    white = white / np.where(scale > 0, scale, 1)
    present = here.astype(np.float64)
    pairs = np.stack([_products(present, lag) for lag in range(1, lags + 1)])
    sums = np.stack([_products(white, lag) for lag in range(1, lags + 1)])
    known = pairs > 0
    correlations = np.where(known, sums / np.maximum(pairs, 1), np.nan)
    width = NormalDist().inv_cdf(0.5 * (1 + confidence))
    total = runs * rows
    statistic = float((total + 2) / total * np.sum(np.where(known, pairs * np.nan_to_num(correlations) ** 2, 0)))
    dof = int(known.sum())
    if dof == 0:
        raise InputError(f"whiteness: no two rows up to {lags} apart have a measurement.")
    return Whiteness(
        channels=tuple(estimate.info.innovation._fields),
        lags=np.arange(1, lags + 1),
        correlations=correlations,
        band=np.where(known, width / np.sqrt(np.maximum(pairs, 1)), np.nan),
        statistic=statistic,
        degrees_of_freedom=dof,
        p_value=chi_squared_tails(statistic, dof)[1],
        confidence=confidence,
    )


def _products(values: np.ndarray, lag: int) -> np.ndarray:
    """Return sums (m, m) over runs and rows of channel i times channel j `lag` rows later."""
    return np.einsum("rti,rtj->ij", values[:, :-lag], values[:, lag:])
