"""Bands that know that the parameters are uncertain, too: a few calibrations that could as well have been found, run side by
side."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.parameter import put
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, SmoothedEstimate, smooth
from jaxveh.fitting import Fit
from jaxveh.statespace import StateSpace

WIDER = 1.75
"""Bands are so many times as wide as members and their filters say: none of them has other equations (a load that shifts within
the axle, a curve that depends on it, a body that rolls). Chosen with `rear_axle_fit.OVERCONFIDENCE` on two fleets of simulated
cars that calibrated themselves (`benchmarks.accuracy`): of 46 drives on smooth roads 95 % bands then hold 93 %, of 45 on uneven
ones 99 %. The errors' tails are long: the 50 % bands hold 59 and 75 %."""


def members(fit: Fit) -> StateSpace:
    """Models about a fit, on a leading axis, whose parameters have its covariance: `z + L h` with the rows h of signs of a
    Hadamard matrix, of which no two columns are alike, so that mean and covariance are exact and no member lies far out."""
    z, covariance = np.asarray(fit.unconstrained), np.asarray(fit.covariance)
    root = np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(len(z)))
    signs = _hadamard(len(z))
    points = jnp.asarray(z + signs @ root.T, fit.unconstrained.dtype)
    at = lambda point: put(
        fit.model, fit.chosen, [p.domain.forward(value) for p, value in zip(fit.chosen, point, strict=True)]
    )
    return eqx.filter_vmap(at)(points)


def _hadamard(columns: int) -> np.ndarray:
    """Signs (n, columns), n a power of two: columns that are orthogonal to each other and to a constant (J. Sylvester 1867)."""
    signs = np.ones((1, 1))
    while len(signs) < columns + 1:
        signs = np.block([[signs, signs], [signs, -signs]])
    return signs[:, 1 : columns + 1]


def smoothed_with_members(filter: AbstractFilter, fit: Fit, log: Recording) -> SmoothedEstimate:
    """The smoother's estimate by a fit, with standard deviations about it of all `members`: what each says, and how far it is
    away."""
    centre = smooth(filter, fit.model, log)
    means, stds = _smoothed(filter, members(fit), log)
    # A member may fail where the fit does not: it says nothing.
    spread = lambda mean, std, at: WIDER * jnp.sqrt(jnp.nanmean(jnp.square(std) + jnp.square(mean - at), axis=0))
    return dataclasses.replace(centre, std=jax.tree.map(spread, means, stds, centre.mean))


@eqx.filter_jit
def _smoothed(filter: AbstractFilter, models: StateSpace, log: Recording) -> tuple[Any, Any]:
    def one(model):
        found = smooth(filter, model, log, throw=False)
        return found.mean, found.std

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0),))(models)
