"""The runs: each drive once, then every estimator on the same drives."""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np

from jaxveh import sweeps
from jaxveh._core.errors import check_whole
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.mass_grade_aukf.contestants import contestants
from jaxveh.experiments.mass_grade_aukf.drives import Drive, drive_once
from jaxveh.experiments.mass_grade_aukf.found import of_a_point
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.sweeps import IN_MEMORY, Stores


class Raced(NamedTuple):
    """One study: the `drives`, (pedals, seeds, T) each, and the results of the estimators, `found`, with the axes estimator,
    pedals, guess and seed."""

    study: Study
    pedals: tuple[float, ...]
    drives: Drive
    found: sweeps.Swept


def drives_of(
    study: Study,
    pedals: tuple[float, ...],
    seeds: int,
    key,
    *,
    batch: int | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Drive:
    """Drives of the study with each pedal activity (m/s^2), one per seed: (pedals, seeds, T)."""
    check_whole("seeds", seeds, 2)
    run = lambda point, key: drive_once(study, point.pedals, key)
    found = stores.sweep(
        "drives", run, sweeps.Design(pedals=pedals), seeds, key, batch=batch, alike=seeds, progress=progress
    )
    return Drive(**{name: found[name] for name in Drive._fields})


def race(
    study: Study,
    pedals: tuple[float, ...],
    drives: Drive,
    *,
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Raced:
    """Every estimator (or `only` these) on the same drives, (pedals, seeds, T), from every first guess."""
    every = contestants(study)
    chosen = {name: every[name] for name in (every if only is None else only)}
    runs = {name: of_a_point(study, contestant) for name, contestant in chosen.items()}
    design = sweeps.Design(estimator=runs, pedals=pedals, guess=study.guesses)
    # The drive is the same for every guess.
    shared = jax.tree.map(
        lambda leaf: np.broadcast_to(leaf[:, None], (len(pedals), len(study.guesses), *leaf.shape[1:])), drives
    )
    run = lambda point, drive: point.estimator(point, drive)
    # All guesses and seeds of one activity: an estimator is one program for lively and gentle pedals and wrong signals.
    alike = len(study.guesses) * np.shape(drives.v_x)[1]
    found = stores.sweep("race", run, design, data=shared, alike=alike, progress=progress)
    return Raced(study, tuple(pedals), drives, found)
