"""Outliers of rig data: whether residuals have heavier tails than normal noise, and the uncertainty of a robust fit.

A robust fit assumes Student's t with 4 degrees of freedom for the residuals, on the scale of their median size: iterated
weights 1 / (1 + r^2 / 4) for residuals r in standard deviations (K. L. Lange, R. J. A. Little and J. M. G. Taylor, Robust
statistical modeling using the t distribution, J. Am. Stat. Assoc. 84 (1989)).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import check_numbers
from jaxveh._core.host import on_host
from jaxveh.fitting.rig_problem import KINK

FAR_RESIDUAL = 4.0
"""Robust standard deviations beyond which a residual counts as far: for normal noise, 0.006 % of rows."""

LEAST_SHARE, LEAST_ROWS = 0.002, 3
"""Share and number of far rows from which tails count as heavy."""

TO_DEVIATION = 1.4826
"""The standard deviation of normal noise over its median size."""


class Tails(NamedTuple):
    """Residuals with heavy tails: the `share` of rows beyond `FAR_RESIDUAL` robust standard deviations, this standard
    `deviation` (in the channel's unit), and the `ratio` of their RMS to it (1 for normal noise)."""

    share: float
    deviation: float
    ratio: float


@on_host
def heavy_tails(residuals: np.ndarray) -> Tails | None:
    """The tails of residuals (n,) of one channel if they are heavier than those of normal noise, otherwise None; nan is left
    out.

    Heavy tails come from outliers, or from a law that fits some rows much worse than the others.
    """
    check_numbers("residuals", residuals)
    residuals = np.asarray(residuals)
    known = residuals[np.isfinite(residuals)]
    deviation = TO_DEVIATION * float(np.median(np.abs(known))) if known.size else 0.0
    if deviation == 0:
        return None
    far = np.abs(known) > FAR_RESIDUAL * deviation
    if far.sum() < max(LEAST_ROWS, LEAST_SHARE * known.size):
        return None
    return Tails(float(far.mean()), deviation, float(np.sqrt(np.mean(known**2)) / deviation))


def inflation(residuals: np.ndarray) -> float:
    """The variance of a robust fit's coefficients over that of its Gauss-Newton matrix, for residuals in standard deviations.

    The variance of an M-estimator is E[psi^2] / E[psi']^2 (P. J. Huber, Robust Statistics (1981), section 7.6), where psi is
    the loss's slope r / (1 + r^2 / 4); the Gauss-Newton matrix counts a row by the squared slope of the bent residual.
    """
    r = residuals[np.isfinite(residuals)]
    x = (r / KINK) ** 2
    psi, slope = r / (1 + x), (1 - x) / (1 + x) ** 2
    # psi over the bent residual, r sqrt(log(1 + x) / x).
    counted = 1 / ((1 + x) ** 2 * np.where(x > 1e-8, np.log1p(x) / np.where(x > 1e-8, x, 1.0), 1.0))
    return float(np.mean(psi**2) * np.mean(counted) / np.mean(slope) ** 2)
