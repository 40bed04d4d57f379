"""A filter's runs on many draws of a model, with the truth."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from jaxveh._core.errors import FilterError, check_flags, check_key, check_whole
from jaxveh._core.parameter import strong
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result
from jaxveh.filters.calibration.batches import check_truth, in_batches
from jaxveh.statespace import AbstractFilter, Info, StateSpace, kit


class Runs(NamedTuple):
    """A filter's runs on R independent draws of a model, as arrays on the host.

    `time` (T,); `states`: the truth, the state's NamedTuple with (R, T) in each field; `mean`: the belief's mean, likewise;
    `covariance` (R, T, n, n) of the belief in the order of the states; `info`: `filters.Info` with (R, T) leaves;
    `log_likelihood` (R,); `result` (R,) the first failing code of each run. States are the model's own (parameters on
    the real line).
    """

    time: np.ndarray
    states: Any
    mean: Any
    covariance: np.ndarray
    info: Info
    log_likelihood: np.ndarray
    result: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """(R, T, n) truth less mean, in the order of the states."""
        return np.stack([truth - mean for truth, mean in zip(self.states, self.mean, strict=True)], axis=-1)


def monte_carlo(
    filter: AbstractFilter,
    model: StateSpace,
    schedule: Recording,
    key,
    runs: int = 100,
    *,
    truth: StateSpace | None = None,
    batch: int | None = None,
    progress: Progress = silent,
    throw: bool = True,
) -> Runs:
    """Run a filter on draws of a model, for NIS, NEES, whiteness and root mean square errors.

    **Arguments**: `schedule`: times, inputs and missing measurements of every run (see `statespace.draw`); `truth`: the model
    that draws, if it is not the filter's own, with the same states, channels and inputs; `batch`: the number of runs at
    a time (default all), if memory is short; `progress(done, total, stage)` is called between batches.

    **Raises** `InputError` where filter, model, truth and schedule do not agree; `FilterError` where runs fail, unless
    `throw=False`.
    """
    check_flags(throw=throw)
    kit.check_told(filter, model)
    model, truth = strong(model), strong(model if truth is None else truth)
    check_whole("runs", runs)
    check_key("monte_carlo", key)
    check_truth(model, truth)
    kit.check_covariance("monte_carlo", filter)
    filter.check(model)
    rows = kit.schedule_rows(truth, schedule)
    drawn = lambda keys: _runs(filter, model, truth, rows, keys)
    found = in_batches(drawn, key, runs, batch, progress, "Monte Carlo runs")
    found = Runs(np.asarray(schedule.time), *found)
    if throw:
        raise_failed(filter, found.result)
    return found


def raise_failed(filter: AbstractFilter, results: np.ndarray) -> None:
    """Raise `FilterError` with the number of failed runs and the reason of the first failure."""
    failed = np.flatnonzero(results)
    if failed.size:
        reason = Result(int(results[failed[0]])).message
        raise FilterError(
            f"{type(filter).__name__} failed in {failed.size} of {results.size} runs, first in run {failed[0]}: {reason}. "
            "throw=False returns the runs as they are."
        )


@eqx.filter_jit
def _runs(filter: AbstractFilter, model: StateSpace, truth: StateSpace, rows, keys):
    def one(key):
        draw_key, filter_key = jax.random.split(key)
        states, measured = kit.draw_rows(truth, rows, draw_key)
        keep = lambda belief: (belief.mean, belief.covariance)
        estimate, (mean, covariance) = kit.scan_and_keep(filter, model, measured, filter_key, keep)
        return states, mean, covariance, estimate.info, estimate.log_likelihood, estimate.result

    return jax.vmap(one)(keys)
