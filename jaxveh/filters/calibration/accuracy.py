"""Root mean square errors beside the bound that holds for any filter."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_kind
from jaxveh.filters.calibration.monte_carlo import Runs
from jaxveh.statespace import PosteriorBound


class Accuracy(NamedTuple):
    """Errors of R runs beside the posterior Cramer-Rao bound; each is the state's NamedTuple with (T,) in each field.

    `rmse`: root mean square error over runs; `standard_error`: that of `rmse`; `bound`: no filter's error is below it,
    except by the scatter of both numbers; `share`: bound over rmse, 1 for the best possible filter and less where the
    filter or the bound is not sharp. `time` (T,).
    """

    time: np.ndarray
    rmse: Any
    standard_error: Any
    bound: Any
    share: Any

    def table(self, skip: int = 0) -> list[tuple[str, float, float, float]]:
        """One line per state: name, rmse and bound (root mean squares over rows), bound over rmse; the first `skip`
        rows are left out."""
        rms = lambda values: float(np.sqrt(np.mean(np.square(values[skip:]))))
        pairs = [(rms(a), rms(b)) for a, b in zip(self.rmse, self.bound, strict=True)]
        return [(name, a, b, b / a) for name, (a, b) in zip(self.rmse._fields, pairs, strict=True)]


def rmse_beside_bound(runs: Runs, bound: PosteriorBound) -> Accuracy:
    """Root mean square errors of `monte_carlo` beside `statespace.posterior_cramer_rao` of the same schedule and of the
    model that drew the runs.

    **Raises** `InputError` where the states or times of the two do not agree, or there are fewer than two runs.
    """
    check_kind("runs", runs, Runs, "filters.monte_carlo returns them.")
    check_kind("bound", bound, PosteriorBound, "statespace.posterior_cramer_rao returns one.")
    if runs.states._fields != bound.std._fields:
        raise InputError(
            f"bound: its states are {', '.join(bound.std._fields)}, the runs' {', '.join(runs.states._fields)}: must agree."
        )
    if not np.array_equal(runs.time, bound.time):
        raise InputError(
            f"bound: the times of its {len(bound.time)} rows differ from those of the runs' {len(runs.time)} rows: must agree."
        )
    squares = runs.error**2
    count = len(squares)
    if count < 2:
        raise InputError(f"runs: {count}; must be at least two.")
    mean = squares.mean(axis=0)
    rmse = np.sqrt(mean)
    # The relative error of a root is half that of its argument.
    scatter = 0.5 * squares.std(axis=0, ddof=1) / np.sqrt(count) / np.where(rmse > 0, rmse, 1)
    kind = type(bound.std)
    lines = np.stack(bound.std, axis=-1)
    share = lines / np.where(rmse > 0, rmse, np.nan)
    return Accuracy(runs.time, kind(*rmse.T), kind(*scatter.T), bound.std, kind(*share.T))
