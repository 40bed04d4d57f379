"""What a smoother made of a recording."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.statespace import Estimate, StateSpace, parameters_of


class SmoothedEstimate(eqx.Module):
    """Each row's quantities given all rows, or those up to a lag behind it.

    `time` (T,); `mean`, `std`: NamedTuples of the model's report with (T,) in each field; `parameters`, `parameters_std` as in
    `Estimate`; `filtered`: the filter's `Estimate`, with log-likelihood, info and result. `trajectories`: draws of whole
    paths, the state's NamedTuple with (T, M) in each field, and their `weights` (M,) (particle smoothers, else None).
    """

    time: Any
    mean: Any
    std: Any
    parameters: Any
    parameters_std: Any
    filtered: Estimate
    trajectories: Any = None
    weights: Any = None

    def __getitem__(self, name: str):
        """The mean of a reported quantity by name, (T,)."""
        return getattr(self.mean, name)


def smoothed_estimate(
    model: StateSpace, filtered: Estimate, moments: Any, trajectories: Any = None, weights: Any = None
) -> SmoothedEstimate:
    """The estimate of `moments`: mean and std of the report, (T,) leaves."""
    mean, std = moments
    show = lambda report: parameters_of(model, report)
    return SmoothedEstimate(filtered.time, mean, std, show(mean), show(std), filtered, trajectories, weights)


def with_last(rows: Any, last: Any) -> Any:
    """The tree of (T-1, ...) leaves with the last row's values behind them."""
    return jax.tree.map(lambda values, end: jnp.concatenate([values, end[None]]), rows, last)
