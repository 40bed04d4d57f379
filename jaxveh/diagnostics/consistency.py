"""Consistency of a filter's errors with its covariance: normalised errors squared, and their chi-squared bands."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.host import on_host
from jaxveh.diagnostics.chi_squared import chi_squared_band, two_sided
from jaxveh.diagnostics.innovations import by_runs_and_rows, check_filtered, checked_skip

FEW_RUNS = 10
"""Least number of runs for which the scatter between runs is used."""


class Consistency(NamedTuple):
    """Squared normalised errors over their degrees of freedom: 1 is expected everywhere.

    `mean`: over all rows and runs; `low`, `high`: its band, which contains it with probability `confidence` if the filter is
    consistent; `p_value`: the two-sided probability of such a mean; `degrees_of_freedom`: of the mean's distribution.
    `by_row` (T,): means over runs, with bands `row_low`, `row_high` (T,), all NaN in rows without errors.
    """

    mean: float
    low: float
    high: float
    p_value: float
    degrees_of_freedom: float
    confidence: float
    by_row: np.ndarray
    row_low: np.ndarray
    row_high: np.ndarray

    @property
    def consistent(self) -> bool:
        """Whether the mean lies in its band."""
        return self.low <= self.mean <= self.high

    @property
    def share_inside(self) -> float:
        """The share of rows inside their own bands; the expected share is about `confidence`."""
        rows = np.isfinite(self.by_row)
        inside = (self.by_row >= self.row_low) & (self.by_row <= self.row_high)
        return float(np.mean(inside[rows]))

    @property
    def verdict(self) -> str:
        """`consistent`, `too confident` (errors larger than the covariance implies) or `too cautious` (smaller)."""
        return "consistent" if self.consistent else "too confident" if not self.mean <= self.high else "too cautious"


@on_host
def nis(estimate: Any, confidence: float = 0.95, skip: int = 0) -> Consistency:
    """Return the normalised innovations squared: chi-squared, and independent between rows, if filter and model are right.

    **Arguments**: `estimate`: any object with a Gaussian filter's `info` with (T,) leaves, or (R, T) for independent runs: an
    `Estimate`, or runs of `filters.monte_carlo`. Each row has as many degrees of freedom as measured channels. `skip`: rows left
    out at the start.

    If the mean is too large, the noises are larger than in the model, or its dynamics are wrong; if it is too small, the filter's
    covariance is too large (Y. Bar-Shalom, X. Li & T. Kirubarajan 2001, sec. 5.4.2, for R runs, and for one run as time average).

    **Raises** `InputError` for particle filters, which have no NIS (use `nis_by_channel`), or if there is no measurement.
    """
    check_filtered("nis", estimate)
    values = by_runs_and_rows(estimate.info.nis, skip)
    counts = np.sum([np.isfinite(by_runs_and_rows(v, skip)) for v in estimate.info.innovation], axis=0)
    if counts.any() and not np.isfinite(values[counts > 0]).any():
        raise InputError("nis: this filter has none (particle filters do not); use nis_by_channel.")
    return _independent_rows("nis", values, counts, confidence)


@on_host
def nis_by_channel(estimate: Any, confidence: float = 0.95, skip: int = 0) -> dict[str, Consistency]:
    """Return the `nis` of each measured channel alone, which shows the sensor whose noise is wrong; a mapping by channel.

    It is the square of each innovation over its predicted standard deviation. The innovations of particle filters are not
    Gaussian for a nonlinear model, and the bands are then approximate.

    **Raises** `InputError` if a predicted standard deviation is not finite (noise without a covariance), or there is no
    measurement.
    """
    check_filtered("nis_by_channel", estimate)
    found = {}
    for name, innovation in estimate.info.innovation._asdict().items():
        scaled = by_runs_and_rows(innovation, skip) / by_runs_and_rows(
            getattr(estimate.info.innovation_std, name), skip
        )
        here = np.isfinite(by_runs_and_rows(innovation, skip))
        if not here.any():
            continue
        if not np.isfinite(scaled[here]).all():
            raise InputError(
                f"nis_by_channel: the predicted standard deviation of {name} is not finite: its noise has no covariance."
            )
        found[name] = _independent_rows(f"nis of {name}", scaled**2, here.astype(int), confidence)
    if not found:
        raise InputError("nis_by_channel: no row has a measurement.")
    return found


@on_host
def nees(error: Any, covariance: Any, confidence: float = 0.95, skip: int = 0) -> Consistency:
    """Return the normalised estimation errors squared, `e^T P^-1 e` against the truth: chi-squared with n degrees of freedom.

    **Arguments**: `error` (R, T, n), truth less estimate of R independent runs, `covariance` (R, T, n, n) in the same order (see
    `filters.monte_carlo`). `skip`: rows left out at the start.

    A row's mean over R runs has R n degrees of freedom (Bar-Shalom, Li & Kirubarajan 2001, sec. 5.4.2). Rows of one run are
    **not** independent: with at least 10 runs, the mean over all rows has effective degrees of freedom from the scatter between
    runs (F. Satterthwaite 1946: 2 mean^2 / variance, of each run's mean), never fewer than a row has; with fewer runs it
    has those of a row, and its band is wider than necessary. For beliefs that are not Gaussian, and particle filters whose
    covariance depends on a few particles, use `filters.simulation_based_calibration`.

    **Raises** `InputError` for shapes that do not agree, or a covariance that is not positive definite.
    """
    error, covariance = np.asarray(error, np.float64), np.asarray(covariance, np.float64)
    if error.ndim != 3 or covariance.shape != (*error.shape, error.shape[-1]):
        raise InputError(
            f"nees: error has shape {error.shape}, covariance {covariance.shape}: must be (R, T, n) and (R, T, n, n); one run "
            "has R = 1."
        )
    error, covariance = error[:, checked_skip(skip, error.shape[1]) :], covariance[:, skip:]
    if not (np.isfinite(error).all() and np.isfinite(covariance).all()):
        raise InputError("nees: an error or a covariance is not finite.")
    # Scaled to unit diagonal first, because states have different units.
    std = np.sqrt(np.maximum(np.einsum("...ii->...i", covariance), 0))
    if not (std > 0).all():
        raise InputError("nees: a variance is not positive; leave out states that are known exactly.")
    try:
        factor = np.linalg.cholesky(covariance / (std[..., :, None] * std[..., None, :]))
    except np.linalg.LinAlgError as failure:
        raise InputError(
            "nees: a covariance is not positive definite; leave out states that follow from others."
        ) from failure
    white = np.linalg.solve(factor, (error / std)[..., None])[..., 0]
    return _dependent_rows(np.sum(white**2, axis=-1) / error.shape[-1], error.shape[-1], confidence)


def _dependent_rows(values: np.ndarray, n: int, confidence: float) -> Consistency:
    """Return the consistency of values (R, T) over their n degrees of freedom, independent between runs but not between rows."""
    runs, rows = values.shape
    by_row, row_dof = values.mean(axis=0), runs * n
    row_low, row_high = (edge / row_dof * np.ones(rows) for edge in chi_squared_band(row_dof, confidence))
    mean, by_run, dof = float(values.mean()), values.mean(axis=1), float(row_dof)
    if runs >= FEW_RUNS and (scatter := by_run.var(ddof=1)) > 0:
        dof = float(np.clip(runs * 2 * mean**2 / scatter, row_dof, row_dof * rows))
    low, high = (edge / dof for edge in chi_squared_band(dof, confidence))
    return Consistency(mean, low, high, two_sided(mean * dof, dof), dof, confidence, by_row, row_low, row_high)


def _independent_rows(what: str, values: np.ndarray, counts: np.ndarray, confidence: float) -> Consistency:
    """Return the consistency of independent values (R, T), each with `counts` (R, T) degrees of freedom."""
    total = int(counts.sum())
    if total == 0:
        raise InputError(f"{what}: no row has a measurement.")
    values = np.where(counts > 0, values, 0)
    if not np.isfinite(values).all():
        raise InputError(
            f"{what}: not finite in row {int(np.argmax(~np.isfinite(values).all(axis=0)))}: the filter failed."
        )
    in_row = counts.sum(axis=0)
    bands = {dof: np.asarray(chi_squared_band(dof, confidence)) / dof for dof in set(in_row.tolist()) if dof > 0}
    bands[0] = np.full(2, np.nan)
    row_low, row_high = np.stack([bands[dof] for dof in in_row.tolist()], axis=1)
    by_row = np.where(in_row > 0, values.sum(axis=0) / np.maximum(in_row, 1), np.nan)
    low, high = (edge / total for edge in chi_squared_band(total, confidence))
    mean = float(values.sum() / total)
    return Consistency(mean, low, high, two_sided(mean * total, total), total, confidence, by_row, row_low, row_high)
