"""A filter's innovations as arrays of runs, rows and channels."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_has


def checked_skip(skip: int, rows: int) -> int:
    """Return `skip`; raise `InputError` unless it leaves at least one of `rows`."""
    if not 0 <= skip < rows:
        raise InputError(f"skip = {skip}: must be from 0 to {rows - 1}, for {rows} rows.")
    return skip


def check_filtered(who: str, estimate: Any) -> None:
    """Raise `InputError` unless `estimate` is that of a filter: the answers of a method have no `info`."""
    check_has(f"{who}: estimate", estimate, ("info",), "filters.run returns one, and filters.monte_carlo returns runs.")


def by_runs_and_rows(values: Any, skip: int = 0) -> np.ndarray:
    """Return (T,) or (R, T) values as (R, T - skip), in float64; raise `InputError` for other shapes."""
    values = np.asarray(values, np.float64)
    if values.ndim not in (1, 2):
        raise InputError(f"values of each row have shape {values.shape}: must be (T,), or (R, T) for several runs.")
    values = np.atleast_2d(values)
    return values[:, checked_skip(skip, values.shape[1]) :]


def whitened_innovations(info: Any, skip: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return innovations over their predicted standard deviations (R, T, m), zero where missing, and which are present (R, T, m).

    They are decorrelated within a row if the filter does so (`info.whitened`); otherwise each channel is scaled alone, which
    leaves rows equally uncorrelated.

    **Raises** `InputError` if a predicted standard deviation is not finite (the noise has no covariance), or there is no
    measurement.
    """
    here = np.stack([np.isfinite(by_runs_and_rows(values, skip)) for values in info.innovation], axis=-1)
    if not here.any():
        raise InputError("innovations: no row has a measurement.")
    if info.whitened is not None:
        white = np.stack([by_runs_and_rows(values, skip) for values in info.whitened], axis=-1)
    else:
        pairs = zip(info.innovation, info.innovation_std, strict=True)
        white = np.stack([by_runs_and_rows(v, skip) / by_runs_and_rows(s, skip) for v, s in pairs], axis=-1)
    lost = here & ~np.isfinite(white)
    if lost.any():
        name = info.innovation._fields[int(np.argmax(lost.any(axis=(0, 1))))]
        raise InputError(
            f"innovations: {name} over its predicted standard deviation is not finite: the filter failed, or the noise has no "
            "covariance."
        )
    return np.where(here, white, 0), here
