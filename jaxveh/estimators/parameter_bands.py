"""Bands that know that the parameters are uncertain, too: a few cars that could as well be this one, run side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.parameter import Parameter, Where, pick, prior_spread, put
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, Estimate, SmoothedEstimate, run, smooth
from jaxveh.fitting import Fit
from jaxveh.fitting import kit as fitting
from jaxveh.statespace import StateSpace, kit

WIDER = 1.75
"""Bands are so many times as wide as members and their filters say: none of them has other equations (a load that shifts within
the axle, a curve that depends on it, a body that rolls). Chosen with `rear_axle_fit.OVERCONFIDENCE` on two fleets of simulated
cars that calibrated themselves (`benchmarks.accuracy`): of 46 drives on smooth roads 95 % bands then hold 93 %, of 45 on uneven
ones 99 %. The errors' tails are long: the 50 % bands hold 59 and 75 %."""


TOLD = 1.0
"""The same of cars at their file's word, whose parameters are much less known. Of 16 simulated drives 95 % bands then hold
99.9 %, 50 % bands 79 (CRPS 1.17 times that of the best constant band): too wide, since noise levels are taken to be unknown,
too. With those taken as known they hold 95 and 62 %, but of three real logs 32 to 71 % in place of 73 to 88."""


class Members(eqx.Module):
    """Models that could as well be the car, on a leading axis; `wider`: what their spread is worth."""

    models: StateSpace
    wider: float = eqx.field(static=True)

    def about(self, centre: Any, means: Any, stds: Any) -> Any:
        """Standard deviations about a `centre` (fields of any shape) of all members (on a leading axis): what each says, and how
        far it is away. A member may fail where the centre does not: it says nothing."""
        size = lambda std, away: self.wider * jnp.sqrt(jnp.nanmean(jnp.square(std) + jnp.square(away), axis=0))
        return jax.tree.map(lambda mean, std, at: size(std, mean - at), means, stds, centre)


def members_of_fit(fit: Fit) -> Members:
    """Models about a fit, whose parameters have its covariance."""
    return Members(_spread(fit.model, fit.chosen, np.asarray(fit.unconstrained), np.asarray(fit.covariance)), WIDER)


def members_of_prior(model: StateSpace, where: Where, prior: Mapping[str, float]) -> Members:
    """Models about one of which no log has told anything: its parameters have the prior's relative spreads."""
    chosen = fitting.scalar_parameters(model, where)
    values = pick(model, chosen)
    spread = np.stack([np.asarray(one) for one in prior_spread(chosen, values, prior)])
    return Members(_spread(model, chosen, np.asarray(fitting.on_line(chosen, values)), np.diag(spread**2)), TOLD)


def _spread(model: StateSpace, chosen: tuple[Parameter, ...], centre: np.ndarray, covariance: np.ndarray) -> StateSpace:
    """Models on a leading axis whose `chosen` parameters, on their own lines, have this mean and covariance: `z + L h` with the
    rows h of signs of a Hadamard matrix, of which no two columns are alike, so that both are exact and no member lies far out."""
    root = np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(len(centre)))
    points = jnp.asarray(centre + _hadamard(len(centre)) @ root.T, centre.dtype)
    return eqx.filter_vmap(lambda point: put(model, chosen, fitting.in_units(chosen, point)))(points)


def _hadamard(columns: int) -> np.ndarray:
    """Signs (n, columns), n a power of two: columns that are orthogonal to each other and to a constant (J. Sylvester 1867)."""
    signs = np.ones((1, 1))
    while len(signs) < columns + 1:
        signs = np.block([[signs, signs], [signs, -signs]])
    return signs[:, 1 : columns + 1]


def estimate_with_members(
    filter: AbstractFilter, model: StateSpace, members: Members, log: Recording, smoothed: bool
) -> Estimate | SmoothedEstimate:
    """The estimate of a model, from all rows or from those before each, with standard deviations that know its `members`."""
    centre = (smooth if smoothed else run)(filter, model, log)
    means, stds = _of_each(filter, members.models, log, smoothed)
    return dataclasses.replace(centre, std=members.about(centre.mean, means, stds))


@eqx.filter_jit
def _of_each(filter: AbstractFilter, models: StateSpace, log: Recording, smoothed: bool) -> tuple[Any, Any]:
    def one(model):
        if smoothed:
            found = smooth(filter, model, log, throw=False)
        else:
            # To the last bit what a live loop says: a batch that is written out rounds otherwise.
            shown, steps = ("mean", "std"), kit.Steps.whole
            found, _ = kit.scan_in_form(filter, model, model.rows(log), None, lambda belief: None, shown, steps)
        return found.mean, found.std

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0),))(models)
