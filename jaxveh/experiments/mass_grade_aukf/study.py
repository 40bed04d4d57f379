"""The runs: drives once, then every estimator on the same drives."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxveh import sweeps
from jaxveh._core.errors import check_whole
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.mass_grade_aukf.contestants import contestants, jitted
from jaxveh.experiments.mass_grade_aukf.drives import Drive, drive_once
from jaxveh.experiments.mass_grade_aukf.settings import Study


class Raced(NamedTuple):
    """One study: the `drives`, (pedals, seeds, T) each, and what the estimators made of them, `found` with the axes estimator,
    pedals, guess and seed."""

    study: Study
    pedals: tuple[float, ...]
    drives: Drive
    found: sweeps.Swept


def race(
    study: Study,
    pedals: tuple[float, ...],
    seeds: int,
    key,
    *,
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
) -> Raced:
    """Every estimator (or `only` these) from every first guess on the same drives: one a seed for each pedal activity (m/s^2)."""
    check_whole("seeds", seeds, 2)
    stage = lambda what, share, first: (
        lambda done, total, said: progress(first + share * done / total, 1.0, f"{what}: {said}")
    )
    drives = sweeps.sweep(
        lambda point, key: drive_once(study, point.pedals, key), sweeps.Design(pedals=pedals), seeds, key,
        progress=stage(f"{study.name}, drives", 0.3, 0.0),
    )  # fmt: skip
    drives = Drive(**{name: drives[name] for name in Drive._fields})
    every = contestants(study)
    chosen = {name: every[name] for name in (every if only is None else only)}
    runs = {name: jitted(study, contestant) for name, contestant in chosen.items()}
    design = sweeps.Design(estimator=runs, pedals=pedals, guess=study.guesses)
    # The drive is the same for every guess.
    shared = jax.tree.map(
        lambda leaf: np.broadcast_to(leaf[:, None], (len(pedals), len(study.guesses), *leaf.shape[1:])), drives
    )
    found = sweeps.sweep(
        lambda point, key, data: point.estimator(point, key, data), design, seeds, key, data=shared,
        progress=stage(study.name, 0.7, 0.3),
    )  # fmt: skip
    return Raced(study, tuple(pedals), drives, found)


def with_changes(study: Study, **changes: Any) -> Study:
    """The study with other settings."""
    return dataclasses.replace(study, **changes)
