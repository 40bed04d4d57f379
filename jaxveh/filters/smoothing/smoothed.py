"""The estimate of a smoother."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.estimated import Estimated, with_prefix
from jaxveh._core.labelled import Labelled
from jaxveh.statespace import Estimate, StateSpace, parameters_of


class SmoothedEstimate(Estimated, eqx.Module):
    """The estimate of each row given all rows, or given the rows up to a lag after it.

    `time` (T,); `mean`, `std`: NamedTuples of the model's report with (T,) in each field; `parameters`, `parameters_std` as in
    `Estimate`; `filtered`: the filter's `Estimate`, with log-likelihood, info and result. `trajectories`: draws of whole
    paths, the state's NamedTuple with (T, M) in each field, and their `weights` (M,) (particle smoothers, otherwise None).
    """

    by_row = ("mean", "std", "parameters", "parameters_std", "trajectories")
    by_run = ("weights",)

    time: Any
    mean: Any
    std: Any
    parameters: Any
    parameters_std: Any
    filtered: Estimate
    trajectories: Any = None
    weights: Any = None

    def _lead(self) -> int:
        return self.filtered._lead()

    def _labelled(self) -> Labelled:
        own, filtered = super()._labelled(), self.filtered._labelled()
        return own._replace(
            variables={**own.variables, **with_prefix(filtered, "filtered")},
            facts={**own.facts, "filtered": filtered.facts},
        )

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> SmoothedEstimate:
        of_filtered = {n: one for n, one in labelled.variables.items() if n.startswith("filtered.")}
        plain = {name.removeprefix("filtered."): one for name, one in of_filtered.items()}
        filtered = Estimate._of_labelled(labelled._replace(variables=plain, facts=labelled.facts["filtered"]))
        return dataclasses.replace(super()._of_labelled(labelled), filtered=filtered)


def smoothed_estimate(
    model: StateSpace, filtered: Estimate, moments: Any, trajectories: Any = None, weights: Any = None
) -> SmoothedEstimate:
    """The estimate with these `moments`: mean and standard deviation of the report, (T,) leaves."""
    mean, std = moments
    show = lambda report: parameters_of(model, report)
    return SmoothedEstimate(filtered.time, mean, std, show(mean), show(std), filtered, trajectories, weights)


def with_last(rows: Any, last: Any) -> Any:
    """The tree `rows` of (T-1, ...) leaves with the values `last` of the last row appended."""
    return jax.tree.map(lambda values, end: jnp.concatenate([values, end[None]]), rows, last)
