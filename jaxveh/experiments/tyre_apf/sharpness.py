"""Auxiliary and plain particle filter compared: by the sensors' noise, the number of particles, and the resampling.

Both resample at every row, multinomially as in the paper; systematic resampling, which has less noise, is shown beside it:
except with sharp sensors it gives the plain filter more than looking ahead does.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, numerics, sweeps, vehicles
from jaxveh._core.parameter import pick, prior_spread, resolve
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.experiments.tyre_apf.settings import LEVELS, NoiseLevel, Study, StudyNoise, tyres
from jaxveh.experiments.tyre_apf.study import auxiliary, drive_once, guess_once, model_of
from jaxveh.sweeps import IN_MEMORY, Stores

PAPERS_PARTICLES = 300
"""The printed number."""

COUNTS = (100, PAPERS_PARTICLES)

AGAIN = 8
"""Number of passes of each filter over the same drive, with other draws."""

Kinds = Mapping[str, Callable[..., filters.AbstractParticleFilter]]

KINDS: Kinds = {"PF": filters.ParticleFilter, "APF": auxiliary}
"""The paper's filters, for which the criteria were asked."""

PREDICTIVE: Kinds = {"PF": filters.ParticleFilter, "APF": filters.AuxiliaryParticleFilter}
"""The same with an auxiliary filter that looks ahead with the process noise: a contestant of its own (`predictive`)."""

SYSTEMATIC = "systematic"
"""The ending of the name of a filter with systematic resampling."""


class Sharpness(NamedTuple):
    """By number of particles, `found` over filter (the prior first), level and seed: `error`, the root mean square of the
    eight parameters' errors in prior standard deviations, over all passes; `likelihood_spread`, the interquartile range of
    the log-likelihood over passes of one drive; `result`."""

    found: dict[int, sweeps.Swept]


def run_sharpness(
    study: Study,
    seeds: int,
    key,
    *,
    counts: Sequence[int] = COUNTS,
    again: int = AGAIN,
    kinds: Kinds | None = None,
    levels: Sequence[NoiseLevel] = LEVELS,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Sharpness:
    """Both filters (`kinds`, by default `KINDS`) with every number of particles at each of the `levels` of noise.

    On the same drives, from the same guesses.
    """
    found = {}
    for i, count in enumerate(counts):
        runs = {name: _passes(study, filter_, again, levels) for name, filter_ in contestants(count, kinds).items()}
        design = sweeps.Design(filter={"prior": _prior(study), **runs}, level=range(len(levels)))
        told = part(progress, i / len(counts), (i + 1) / len(counts), f"{count} particles")
        run = lambda point, key: point.filter(point.level, key)
        found[count] = stores.under(f"{count}-particles").sweep("passes", run, design, seeds, key, progress=told)
    return Sharpness(found)


def contestants(count: int, kinds: Kinds | None = None) -> dict[str, filters.AbstractParticleFilter]:
    """Both filters with `count` particles; with the paper's number, in both ways of resampling."""
    kinds = KINDS if kinds is None else kinds
    chosen = {name: kind(count, numerics.multinomial) for name, kind in kinds.items()}
    if count == PAPERS_PARTICLES:
        chosen |= {f"{name}, {SYSTEMATIC}": kind(count, numerics.systematic) for name, kind in kinds.items()}
    return chosen


def errors_of(study: Study, values):
    """The errors of `values` (..., 8) in prior standard deviations."""
    car = vehicles.passenger_car()
    chosen = resolve(car, tyres)
    truth = pick(car, chosen)
    spreads = prior_spread(chosen, truth, study.prior)
    parts = [
        (p.domain.inverse(values[..., i]) - p.domain.inverse(t)) / s
        for i, (p, t, s) in enumerate(zip(chosen, truth, spreads, strict=True))
    ]
    return jnp.stack(parts, axis=-1)


def _rms(errors):
    return jnp.sqrt(jnp.mean(errors**2))


def _prior(study: Study):
    def run(level, key):
        guess = guess_once(study, jax.random.fold_in(key, 2))
        values = jnp.stack(pick(guess, resolve(guess, tyres)))
        return {"error": _rms(errors_of(study, values)), "likelihood_spread": jnp.nan * level, "result": jnp.int32(0)}

    return run


def _passes(study: Study, filter_, again: int, levels: Sequence[NoiseLevel]):
    def run(level, key):
        at = lambda which: jnp.asarray([which(one) for one in levels])[level.astype(int)]
        noise = StudyNoise(
            *(at(lambda one, name=name: getattr(one.noise, name)) for name in ("v_y", "yaw_rate", "walk"))
        )
        chosen = NoiseLevel(at(lambda one: one.yaw_rate), at(lambda one: one.a_y), noise)
        last, likelihood, result = several_passes(study, filter_, chosen, again, key)
        low, high = jnp.quantile(likelihood, jnp.asarray([0.25, 0.75]))
        return {
            "error": _rms(errors_of(study, last)),
            "likelihood_spread": high - low,
            "result": jnp.max(result).astype(jnp.int32),
        }

    return run


def several_passes(study: Study, filter_, level: NoiseLevel, again: int, key) -> tuple[jax.Array, jax.Array, jax.Array]:
    """`again` passes over one lane change at a level: the last parameters (again, 8), log-likelihoods and results (again,)."""
    guess = guess_once(study, jax.random.fold_in(key, 2))
    model = model_of(_at(study, level), guess, level.noise)
    rows = model.rows(drive_at(study, level, key))

    def once(key):
        estimate = filters.scan(filter_, model, rows, key)
        last = jnp.stack([one[-1] for one in estimate.parameters.values()])
        return last, estimate.log_likelihood, estimate.result

    return jax.vmap(once)(jax.random.split(jax.random.fold_in(key, 3), again))


def drive_at(study: Study, level: NoiseLevel, key) -> Recording:
    """The lane change of `several_passes`, measured with the level's noise."""
    return drive_once(_at(study, level), jax.random.fold_in(key, 1))


def _at(study: Study, level: NoiseLevel) -> Study:
    return dataclasses.replace(study, yaw_rate_std=level.yaw_rate, a_y_std=level.a_y)


def pairs(runs: sweeps.Swept) -> list[tuple[str, str]]:
    """The auxiliary filters among these, each with its plain one."""
    names = runs.design.axis("filter").labels
    return [
        (name, name.removeprefix("A")) for name in names if name.startswith("APF") and name.removeprefix("A") in names
    ]


def likelihood_ratio(result: Sharpness, count: int, level: int, auxiliary: str = "APF", plain: str = "PF") -> float:
    """The interquartile range of the APF's log-likelihood over the PF's: ratio of the medians over seeds."""
    spread = lambda name: np.median(result.found[count].at("likelihood_spread", filter=name, level=float(level)))
    return float(spread(auxiliary) / spread(plain))
