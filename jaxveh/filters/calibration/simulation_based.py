"""Simulation-based calibration: the truth's rank among draws of the belief is uniform if filter and model are right."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, check_flags, check_key, check_whole, is_whole
from jaxveh._core.parameter import strong
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import chi_squared_tails
from jaxveh.filters.calibration.batches import check_truth, in_batches
from jaxveh.filters.calibration.monte_carlo import raise_failed
from jaxveh.statespace import AbstractFilter, StateSpace, kit, scan


class CalibrationRanks(NamedTuple):
    """Ranks of the truth: the state's NamedTuple with (R,) whole numbers from 0 to `draws` in each field."""

    ranks: Any
    draws: int

    def histogram(self, bins: int = 10) -> Any:
        """The number of runs in each bin of ranks: the state's NamedTuple with (bins,) in each field.

        A hump in the middle means that the belief is too wide, heaps at both ends that it is too narrow, a slope that
        it is biased.

        **Raises** `InputError` unless `bins` divides draws + 1.
        """
        if not is_whole(bins) or bins < 2 or (self.draws + 1) % bins:
            raise InputError(
                f"bins = {bins}: must be a whole number of at least 2 that divides draws + 1 = {self.draws + 1}."
            )
        width = (self.draws + 1) // bins
        return type(self.ranks)(*[np.bincount(rank // width, minlength=bins) for rank in self.ranks])

    def p_values(self, bins: int = 10) -> Any:
        """Pearson's chi-squared test of uniform ranks: by state, the probability of a histogram at least as uneven.

        **Raises** `InputError` as `histogram`, and for fewer than five runs per bin, where the test's distribution does
        not hold.
        """
        runs = len(self.ranks[0])
        if runs < 5 * bins:
            raise InputError(f"bins = {bins}: must be at most {runs // 5}, a fifth of the runs.")
        expected = runs / bins
        p_value = lambda counts: chi_squared_tails(float(np.sum((counts - expected) ** 2) / expected), bins - 1)[1]
        return type(self.ranks)(*[p_value(counts) for counts in self.histogram(bins)])

    def is_calibrated(self, level: float = 0.01, bins: int = 10) -> bool:
        """Whether no state's test rejects; a correct filter is rejected with a probability of at most `level` (Bonferroni)."""
        check("level", level, lambda p: (p > 0) & (p < 1), "above 0 and below 1")
        return min(self.p_values(bins)) >= level / len(self.ranks)


def simulation_based_calibration(
    filter: AbstractFilter,
    model: StateSpace,
    schedule: Recording,
    key,
    runs: int = 500,
    draws: int = 99,
    *,
    truth: StateSpace | None = None,
    batch: int | None = None,
    progress: Progress = silent,
    throw: bool = True,
) -> CalibrationRanks:
    """Rank the true last state among `draws` from the belief after the last row, in each of `runs` draws of the model.

    If the filter is exact, the truth and the draws from the belief are exchangeable, so that all ranks are equally
    likely, whatever the model (S. Talts, M. Betancourt, D. Simpson, A. Vehtari & A. Gelman 2018). A particle filter is
    exact only with many particles, a Gaussian filter only where beliefs are Gaussian.

    **Arguments**: as `monte_carlo`. **Raises** likewise.
    """
    check_flags(throw=throw)
    kit.check_told(filter, model)
    model, truth = strong(model), strong(model if truth is None else truth)
    check_whole("runs", runs)
    check_key("simulation_based_calibration", key)
    check_whole("draws", draws)
    check_truth(model, truth)
    filter.check(model)
    rows = kit.schedule_rows(truth, schedule)
    one_batch = lambda keys: _ranks(filter, model, truth, rows, keys, draws)
    ranks, results = in_batches(one_batch, key, runs, batch, progress, "simulation-based calibration")
    if throw:
        raise_failed(filter, results)
    return CalibrationRanks(ranks, draws)


@eqx.filter_jit
def _ranks(filter: AbstractFilter, model: StateSpace, truth: StateSpace, rows, keys, draws: int):
    def one(key):
        draw_key, filter_key, belief_key = jax.random.split(key, 3)
        states, measured = kit.draw_rows(truth, rows, draw_key)
        estimate = scan(filter, model, measured, filter_key)
        drawn = estimate.belief.sample(belief_key, draws)
        rank = lambda values, path: jnp.sum(values < path[-1])
        return jax.tree.map(rank, drawn, states), estimate.result

    return jax.vmap(one)(keys)
