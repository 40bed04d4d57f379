"""The runs: each drive once, then every method on the same drives."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxveh import sweeps
from jaxveh._core.errors import check_whole
from jaxveh._core.names import check_names
from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.sideslip_review.contestants import WHAT, Found, Group, groups
from jaxveh.experiments.sideslip_review.drives import Drive, drive_once, scenario_at
from jaxveh.experiments.sideslip_review.models import models_of, sheet_cars
from jaxveh.experiments.sideslip_review.settings import SCENARIOS, Study
from jaxveh.sweeps import IN_MEMORY, Stores

EVERY = 10
"""Rows between those of the courses that are kept."""

SLOW = 2.0
"""s of the moving mean; the remainder is the fast part."""


class Raced(NamedTuple):
    """One study: the `drives`, (scenarios, seeds, T) each, and the results of the methods, `found`: by method's name, by
    metric, (scenarios, seeds, ...)."""

    study: Study
    scenarios: tuple[str, ...]
    drives: Drive
    found: dict[str, dict[str, np.ndarray]]

    def at(self, metric: str, name: str, scenario: str) -> np.ndarray:
        """The values of a method in a scenario, (seeds, ...)."""
        return self.found[name][metric][self.scenarios.index(scenario)]


def drives_of(
    study: Study,
    seeds: int,
    key,
    *,
    scenarios: tuple[str, ...] = tuple(SCENARIOS),
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Drive:
    """Drives of the scenarios, one per seed: (scenarios, seeds, T). A seed has the same steering in all scenarios of one
    pace, and one car."""
    check_whole("seeds", seeds, 2)
    run = lambda point, key: drive_once(study, scenario_at(point.scenario), key)
    found = stores.sweep("drives", run, _design(scenarios), seeds, key, progress=progress)
    return Drive(**{name: found[name] for name in Drive._fields})


def _design(scenarios: tuple[str, ...]) -> sweeps.Design:
    check_names("scenarios", scenarios, SCENARIOS)
    return sweeps.Design(scenario=[float(list(SCENARIOS).index(name)) for name in scenarios])


def race(
    study: Study,
    drives: Drive,
    key,
    *,
    scenarios: tuple[str, ...] = tuple(SCENARIOS),
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Raced:
    """Every method (or `only` these) on the same drives, (scenarios, seeds, T); filters draw from `key`."""
    wanted = tuple(WHAT) if only is None else only
    check_names("only", wanted, WHAT)
    cars = sheet_cars()
    every = groups(study, cars, models_of(cars, study.noise, study.speed))
    chosen = [group for group in every if set(group.names) & set(wanted)]
    seeds, found = np.shape(drives.v_x)[1], {}
    for i, group in enumerate(chosen):
        told = part(progress, i / len(chosen), (i + 1) / len(chosen), ", ".join(group.names))
        run = _score(study, group)
        swept = stores.under(group.names[0].replace(" ", "-")).sweep(
            "race", run, _design(scenarios), seeds, key, data=drives, progress=told
        )
        for path, values in swept.values.items():
            name, metric = path.rsplit(".", 1)
            found.setdefault(name, {})[metric] = values
    return Raced(study, scenarios, drives, {name: found[name] for name in WHAT if name in wanted})


def _score(study: Study, group: Group):
    """The group's run of one drive, as `sweeps.sweep` calls it."""

    def run(point, key, drive):
        del point
        return {name: metrics(study, found, drive) for name, found in group.run(drive, key).items()}

    return run


def metrics(study: Study, found: Found, drive: Drive) -> dict[str, Any]:
    """Root mean squares in degrees of sideslip's error and of sideslip itself (`of_`): over the beginning (`early`), over
    the end (`late`), and of the fast part in the beginning (`fast`); whether the run `failed`; the `course` of the
    estimate."""
    sideslip = jnp.arctan2(found.v_y, drive.v_x)
    wrong, true = jnp.rad2deg(sideslip - drive.sideslip), jnp.rad2deg(drive.sideslip)
    time = drive.time - drive.time[0]
    early = (time >= study.warm_up) & (time <= study.span)
    late = time >= jnp.maximum(time[-1] - study.span, study.warm_up)
    rms = lambda values, rows: jnp.sqrt(jnp.sum(jnp.where(rows, values**2, 0.0)) / jnp.sum(rows.astype(wrong.dtype)))
    window = round(SLOW / study.dt)
    found_values = {"early": rms(wrong, early), "late": rms(wrong, late), "fast": rms(fast_part(wrong, window), early)}
    own = {"early": rms(true, early), "late": rms(true, late), "fast": rms(fast_part(true, window), early)}
    failed = (found.result != 0) | ~jnp.all(jnp.isfinite(sideslip))
    return {
        **found_values,
        **{f"of_{name}": value for name, value in own.items()},
        "failed": failed.astype(wrong.dtype),
        "course": sideslip[::EVERY],
    }


def fast_part(values, window: int):
    """The values (T,) less their mean over `window` rows about each; near either end the mean is over fewer rows."""
    total = jnp.pad(jnp.cumsum(values), (1, 0))
    rows = jnp.arange(values.shape[0])
    low, high = jnp.maximum(rows - window // 2, 0), jnp.minimum(rows + window // 2 + 1, values.shape[0])
    return values - (total[high] - total[low]) / (high - low).astype(values.dtype)
