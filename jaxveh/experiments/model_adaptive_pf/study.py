"""The runs: each drive once, then every estimator on the same drives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import sweeps
from jaxveh._core.errors import check_whole
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.model_adaptive_pf.contestants import Contestant, contestants, of_a_point
from jaxveh.experiments.model_adaptive_pf.drives import Drive, drive_once, fiala
from jaxveh.experiments.model_adaptive_pf.settings import Case, Study
from jaxveh.sweeps import IN_MEMORY, Stores

ALIKE = 8
"""Runs at a time: a filter is one program in all races. Steps of so few runs are not written out: compiling takes two thirds of
the time (9 instead of 15 s of a cubature filter), which saves more than the runs lose (3 instead of 1 s)."""


class Raced(NamedTuple):
    """The `drives`, (cases, seeds, T) each, of `cases` by name, and the results of the estimators, `found`, with the axes
    estimator, case and seed."""

    study: Study
    cases: dict[str, Case]
    drives: Drive
    found: sweeps.Swept

    def of(self, name: str, estimator: str, case: str) -> np.ndarray:
        """Values by seed."""
        return self.found.at(name, estimator=estimator, case=float(list(self.cases).index(case)))


def drives_of(
    study: Study,
    cases: Mapping[str, Case],
    seeds: int,
    key,
    *,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Drive:
    """Drives of each case, one per seed: (cases, seeds, T)."""
    check_whole("seeds", seeds, 2)
    columns = Case(*(jnp.asarray(np.array(values, float)) for values in zip(*cases.values(), strict=True)))

    def run(point, key):
        case = jax.tree.map(lambda column: column[point.case.astype(int)], columns)
        return drive_once(study, case, key)

    found = stores.sweep("drives", run, _design(cases), seeds, key, progress=progress)
    return Drive(**{name: found[name] for name in Drive._fields})


def race(
    study: Study,
    cases: Mapping[str, Case],
    drives: Drive,
    key,
    *,
    only: tuple[str, ...] | None = None,
    entrants: Mapping[str, Contestant] | None = None,
    tyre: Callable[..., Any] = fiala,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Raced:
    """Every estimator (or `only` these, or other `entrants`) on the same drives, (cases, seeds, T); filters draw from
    `key`."""
    every = contestants(study) if entrants is None else entrants
    chosen = {name: every[name] for name in (every if only is None else only)}
    seeds = np.shape(drives.v_x)[1]
    own = Case(*(np.repeat(np.array(values, float)[:, None], seeds, 1) for values in zip(*cases.values(), strict=True)))
    runs = {name: of_a_point(study, contestant, tyre) for name, contestant in chosen.items()}
    design = sweeps.Design(estimator=runs, **{axis.name: axis.values for axis in _design(cases).axes})
    run = lambda point, key, data: point.estimator(point, key, data)
    found = stores.sweep("race", run, design, seeds, key, data=(own, drives), alike=ALIKE, progress=progress)
    return Raced(study, dict(cases), drives, found)


def _design(cases: Mapping[str, Case]) -> sweeps.Design:
    return sweeps.Design(case=range(len(cases)))
