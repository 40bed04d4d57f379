"""Every method of every quantity on the same drives, with its metrics."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import estimators, numerics, sweeps
from jaxveh._core.errors import InputError, check_whole
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import delay_of_rows
from jaxveh.estimators import AbstractMethod, kit
from jaxveh.experiments.sideslip_review.chapters.fleet import CARS, built_cars, told_cars
from jaxveh.experiments.sideslip_review.chapters.fleet_drives import drive_once
from jaxveh.experiments.sideslip_review.chapters.scenarios import SCENARIOS, scenario_at
from jaxveh.io import CarSpecification
from jaxveh.sweeps import IN_MEMORY, Stores

CHAPTERS = {
    "lateral velocity": ("sideslip", "navigation"),
    "longitudinal speed": ("speed",),
    "friction": ("friction",),
    "cornering stiffness": ("stiffness",),
    "bank, grade and roll": ("bank", "grade", "roll"),
    "mass and geometry": ("mass", "geometry"),
}
"""The review's chapters, and the quantities of `jaxveh.estimators` that belong to each."""

LATEST = 100
"""Rows: the largest delay or lead of an estimate that is looked for."""

STEP = 0.01
"""s: between rows, of the fastest device."""

LEANS = ("true.sideslip", "true.roll")


class ChaptersRaced(NamedTuple):
    """`drives`: (scenarios, seeds, T) by channel; `found`: by quantity, method and shown name, values by metric, (scenarios,
    seeds); `nothing`: the same for doing nothing, by quantity and name; `left_out`: why a method was left out, by quantity
    and method."""

    drives: Mapping[str, np.ndarray]
    found: dict[tuple[str, str, str], dict[str, np.ndarray]]
    nothing: dict[tuple[str, str], dict[str, np.ndarray]]
    left_out: dict[tuple[str, str], str]


def quantities() -> dict[str, ModuleType]:
    """The quantities of all chapters, by name."""
    return {name: getattr(estimators, name) for names in CHAPTERS.values() for name in names}


def channels_kept() -> tuple[str, ...]:
    """The channels of a drive that are kept: those that a method reads, and the truths."""
    shown = {f"true.{name}" for module in quantities().values() for name in module.SHOWN}
    read = set()
    for module in quantities().values():
        for one in module.METHODS.values():
            with contextlib.suppress(InputError):
                read |= {need.channel for need in one.make(told_cars()[0]).needs}
    return tuple(sorted(shown | read | {"true.v_x", *LEANS}))


def chapter_drives(
    seeds: int,
    key,
    *,
    duration: float,
    cars: tuple[str, ...] = CARS,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Mapping[str, np.ndarray]:
    """Drives of all scenarios, one per seed: (scenarios, seeds, T) each. A seed has the same steering in all of them, and
    one car; `car` (scenarios, seeds): its index in `cars`."""
    check_whole("seeds", seeds, 2)
    built, wanted = built_cars(cars), channels_kept()

    def run(point, key):
        index = jax.random.randint(jax.random.fold_in(key, 1), (), 0, len(cars))
        one = jax.tree.map(lambda leaf: leaf[index], built)
        made = drive_once(one, scenario_at(point.scenario), key, duration=duration)
        return {name: made[name] for name in wanted if name in made} | {"car": index}

    drives = stores.sweep("drives", run, _design(), seeds, key, progress=part(progress, 0.0, 0.9, "drives")).values
    return {
        **drives,
        "v_x": _told_speed(drives, told_cars(cars), seeds, key, stores, part(progress, 0.9, 1.0, "speed")),
    }


def _told_speed(
    drives: Mapping[str, np.ndarray], cars: list[CarSpecification], seeds: int, key, stores: Stores, progress: Progress
) -> np.ndarray:
    """The speed that methods of other quantities are told: no car measures it, so it is our own causal estimate."""
    module = estimators.speed
    methods = [module.METHODS[module.RECOMMENDED].make(car) for car in cars]
    # The same program as that of the race.
    run = _run(methods, functools.partial(_series, list(module.SHOWN)))
    data = _data(module, methods[0], drives)
    return stores.sweep("speed", run, _design(), seeds, key, data=data, progress=progress).values["mean.v_x"]


def _design() -> sweeps.Design:
    return sweeps.Design(scenario=[float(i) for i in range(len(SCENARIOS))])


def race_methods(
    drives: Mapping[str, np.ndarray],
    seeds: int,
    key,
    *,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> ChaptersRaced:
    """All methods on the drives."""
    found: dict = {}
    left_out: dict = {}
    every = [(quantity, module, name) for quantity, module in quantities().items() for name in module.METHODS]
    for i, (quantity, module, name) in enumerate(every):
        told = part(progress, i / len(every), (i + 1) / len(every), f"{quantity}: {name}")
        try:
            methods = [module.METHODS[name].make(car) for car in told_cars()]
        except InputError as error:
            left_out[quantity, name] = str(error)
            continue
        lacking = [need.channel for need in methods[0].needs if not need.optional and need.channel not in drives]
        if lacking:
            left_out[quantity, name] = f"the drives have no {', '.join(lacking)}"
            continue
        shown = [one for one in module.SHOWN if f"true.{one}" in drives]
        run, data = _run(methods, functools.partial(_series, shown)), _data(module, methods[0], drives)
        score = functools.partial(_score, shown)
        swept = (
            stores.under(quantity)
            .under(name)
            .sweep("race", run, _design(), seeds, key, data=data, score=score, progress=told)
        )
        for path, values in swept.values.items():
            one, metric = path.rsplit(".", 1)
            found.setdefault((quantity, name, one), {})[metric] = values
    return ChaptersRaced(drives, found, _nothing(drives), left_out)


def _data(module: ModuleType, method: AbstractMethod, drives: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    wanted = {need.channel for need in method.needs} | {f"true.{name}" for name in module.SHOWN} | {"car", "true.v_x"}
    return {name: drives[name] for name in sorted(wanted) if name in drives} | {"held": np.asarray(held_rows(drives))}


def _run(methods: list[AbstractMethod], conclude: Callable[[Any, dict], dict]):
    """One drive of a seed, as `sweeps.sweep` calls it: `conclude(answers, drive)` for the method made from the file of the
    seed's car."""
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *[eqx.filter(one, eqx.is_array) for one in methods])
    rest = eqx.filter(methods[0], eqx.is_array, inverse=True)

    def run(point, key, drive):
        del point, key
        own = eqx.combine(jax.tree.map(lambda leaf: leaf[drive["car"]], stacked), rest)
        v_x = drive["true.v_x"]
        time = STEP * jnp.arange(v_x.shape[0], dtype=v_x.dtype)
        none = jnp.full_like(v_x, jnp.nan)
        values = {need.channel: drive.get(need.channel, none) for need in own.needs}
        return conclude(kit.follow_rows(own, time, values), drive)

    return run


def _series(shown: list[str], said: Any, drive: dict) -> dict[str, Any]:
    """What a method says of the quantities `shown`, in every row."""
    del drive
    return {part: {name: getattr(getattr(said, part), name) for name in shown} for part in ("mean", "std", "known")}


def _score(shown: list[str], said: dict[str, Any], drive: dict) -> dict[str, Any]:
    """The metrics of the quantities `shown`, of one drive."""
    of = lambda part: jnp.stack([said[f"{part}.{name}"] for name in shown])
    truth = jnp.stack([drive[f"true.{name}"] for name in shown])
    found = jax.vmap(metrics, in_axes=(0, 0, 0, 0, None))(of("mean"), of("std"), of("known"), truth, drive["held"])
    return {name: {metric: values[i] for metric, values in found.items()} for i, name in enumerate(shown)}


WARM_UP = 5.0
"""s at the beginning that are not scored."""


LOST = np.radians(20.0)
"""rad of sideslip, or of roll: from there on a car has spun or tipped over, and the rest of the drive is not scored."""


def held_rows(drive: Mapping[str, Any]) -> Any:
    """The rows (..., T) up to the one in which the driver loses the car."""
    furthest = functools.reduce(jnp.maximum, [jnp.abs(drive[name]) for name in LEANS])
    return jnp.cumprod((furthest < LOST).astype(int), axis=-1) > 0


def metrics(mean, std, known, truth, held) -> dict[str, Any]:
    """Metrics of one drive: root mean square error over the first and the second half (`early`, `late`), over all (`rmse`)
    and over the rows that the method marks as known (`rmse_known`), the largest error (`worst`), the share of known rows
    (`known`), the mean square of the error over its standard deviation in known rows (`nees`, NaN without a standard
    deviation), the delay in seconds (`delay`), and whether it was not finite throughout (`failed`); for rows in which the
    car is `held`."""
    rows = jnp.arange(truth.shape[0])
    warm, half = held & (rows >= round(WARM_UP / STEP)), rows.shape[0] // 2
    finite = jnp.isfinite(mean) & held
    error = jnp.where(finite, mean - truth, 0.0)
    count = lambda which: jnp.sum(which.astype(error.dtype))
    rms = lambda which, of=error: jnp.sqrt(jnp.sum(jnp.where(which, of**2, 0.0)) / count(which))
    sure = warm & finite & known
    claimed = sure & (std > 0.0)
    late = delay_of_rows(jnp.where(finite, mean, 0.0), truth, warm & finite, LATEST)
    return {
        "rmse": rms(warm & finite), "early": rms(warm & finite & (rows < half)), "late": rms(finite & (rows >= half)),
        "rmse_known": rms(sure), "worst": numerics.largest(jnp.where(warm & finite, jnp.abs(error), 0.0)),
        "known": count(warm & known) / count(warm),
        "nees": rms(claimed, error / numerics.or_one(std, claimed)) ** 2,
        "delay": STEP * late, "failed": 1.0 - jnp.all(finite | ~warm).astype(error.dtype),
    }  # fmt: skip


def _nothing(drives: Mapping[str, np.ndarray]) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """The errors of doing nothing, by quantity and name."""
    found = {}
    shape, all_held = drives["car"].shape, np.asarray(held_rows(drives))
    for quantity, module in quantities().items():
        for name in module.SHOWN:
            if f"true.{name}" in drives:
                found[quantity, name] = {"rmse": np.full(shape, np.nan)}
        for place in np.ndindex(shape):
            log = _log(drives, place)
            try:
                guess = module.do_nothing(told_cars()[int(drives["car"][place])], log)
            except InputError:
                continue
            for name, values in guess.items():
                if (quantity, name) in found:
                    error = np.asarray(values) - drives[f"true.{name}"][place]
                    held = all_held[place].copy()
                    held[: round(WARM_UP / STEP)] = False
                    squares = error[held & np.isfinite(error)] ** 2
                    # A car that spins in the first seconds has no row that is scored.
                    found[quantity, name]["rmse"][place] = np.sqrt(np.mean(squares)) if squares.size else np.nan
    return found


def _log(drives: Mapping[str, np.ndarray], place) -> Recording:
    channels = {
        name: np.asarray(v[place]) for name, v in drives.items() if name != "car" and not name.startswith("true.")
    }
    rows = drives["true.v_x"][place].shape[0]
    return Recording(STEP * np.arange(rows), channels)
