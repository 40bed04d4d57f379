"""The report: tables, checks against honest criteria, and the results of the printed settings."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import numpy as np

from jaxveh._core.progress import Progress, part, silent
from jaxveh.diagnostics import Observability
from jaxveh.experiments.federated_ckf.contestants import contestants
from jaxveh.experiments.federated_ckf.criteria import (
    CRITERIA,
    GATE,
    ISOLATION,
    OTHER,
    SHORT,
    SMALL_STEER,
    STARTS,
    consistent,
    final,
    sideslip,
)
from jaxveh.experiments.federated_ckf.drives import Drive
from jaxveh.experiments.federated_ckf.observed import observability_of_drives
from jaxveh.experiments.federated_ckf.road_drives import drives_on_roads, road_cases
from jaxveh.experiments.federated_ckf.road_filters import ROAD_START, race_on_roads
from jaxveh.experiments.federated_ckf.road_tables import road_tables, speed_table
from jaxveh.experiments.federated_ckf.settings import PARAMETERS, Start, Study
from jaxveh.experiments.federated_ckf.study import Raced, cases, drives_by_case, drives_of, race, race_over, truth
from jaxveh.experiments.report import Check, above, at_most, interval, spread, with_terms
from jaxveh.sweeps import IN_MEMORY, Stores, Swept, Table, compare

STEERS, SPREADS = (3.0, 4.0, 5.0, 8.0), (0.0, 0.1, 0.3)
"""Steer amplitudes (degrees) and standard deviations of the speed (m/s) of the drives whose information is computed."""

NEES = (0.25, 4.0)
"""Bounds within which a filter's covariance agrees with its errors."""

LIMITS = {"friction": 1.0, "mass": 2.0, "yaw_inertia": 5.0, "front_axle_to_cg": 2.0}
"""Limits of the final errors, %."""


class Reproduction(NamedTuple):
    """All results of the experiment: `raced`, all estimators in all cases; over `steers` (degrees) and `spreads` (m/s) the
    joint filter's errors, `over`, and the observability in the first seed's drive, `seen`, with the rolling resistance known
    and unknown; `roads`: one friction and four on roads with several frictions, and rear wheels that turn."""

    seeds: int
    raced: Raced
    steers: tuple[float, ...]
    spreads: tuple[float, ...]
    over: Swept
    seen: dict[str, list[list[Observability]]]
    roads: Raced


def run(
    study: Study | None = None,
    *,
    seeds: int = 20,
    seed: int = 0,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Reproduction:
    """All drives and estimators over `seeds` seeds (at least two)."""
    study = study or Study()
    # Other drives than those on which the noises were chosen.
    key = jax.random.fold_in(jax.random.key(seed), 2)
    steers = tuple(sorted({*np.radians(STEERS).tolist(), study.steer}))
    speeds = tuple(sorted({*SPREADS, study.speed_std}))
    grid = drives_of(study, steers, speeds, seeds, key, progress=part(progress, 0.0, 0.08, "drives"), stores=stores)
    names = tuple(cases(study))
    # The paper's slalom is one of the grid's drives.
    own = steers.index(study.steer), speeds.index(study.speed_std)
    known = Drive(*(leaf[own] for leaf in grid))
    told = part(progress, 0.08, 0.15, "other tyres")
    drives = drives_by_case(study, names, seeds, key, known=known, progress=told, stores=stores)
    raced = race(study, drives, names, progress=part(progress, 0.15, 0.65, "estimators"), stores=stores)
    told = part(progress, 0.65, 0.7, "roads")
    rough = drives_on_roads(study, seeds, jax.random.fold_in(key, 1), progress=told, stores=stores)
    told = part(progress, 0.7, 0.9, "estimators on roads")
    on_roads = race_on_roads(study, rough, progress=told, stores=stores)
    told = part(progress, 0.9, 0.96, "steer and speed")
    over = race_over(study, grid, steers, speeds, progress=told, stores=stores)
    progress(0.96, 1.0, "observability")
    seen = observability_of_drives(study, Start(*truth(study)), Drive(*(leaf[:, :, 0] for leaf in grid)))
    progress(1.0, 1.0, "done")
    return Reproduction(seeds, raced, tuple(np.degrees(steers).tolist()), speeds, over, seen, on_roads)


def settings(result: Reproduction) -> dict:
    """The study, for a manifest."""
    study = result.raced.study
    own = {name: case._replace(start=dataclasses.asdict(case.start))._asdict() for name, case in cases(study).items()}
    roads = {name: case._asdict() for name, case in road_cases(study).items()}
    return {
        "study": dataclasses.asdict(study),
        "cases": own,
        "roads": roads,
        "road_start": dataclasses.asdict(ROAD_START),
    }


def _median(values) -> float:
    return float(np.quantile(np.where(np.isnan(values), np.inf, values), 0.5, method="nearest"))


def check(result: Reproduction) -> list[Check]:
    """The criteria, each with its condition (`criteria`): medians over seeds."""
    raced, found = result.raced, []
    median = lambda name, estimator, case: _median(raced.at(name, estimator, case))
    for case in (*STARTS, OTHER):
        for name, limit in LIMITS.items():
            found.append(at_most(final(case, name), 100 * median(f"{name}_error", "joint", case), limit))
        found += _nees("joint", case, median("nees", "joint", case))
    for case in STARTS:
        ratio = median("sideslip_rmse", "redesigned", case) / median("sideslip_rmse", "joint", case)
        found.append(at_most(sideslip(case), ratio, 1.1))
        found += _nees("redesigned", case, median("nees", "redesigned", case))
    faulty = median("sideslip_rmse", "redesigned, isolating", "fault") / median("sideslip_rmse", "redesigned", "fault")
    found.append(at_most(ISOLATION, faulty, 0.6))
    gated = [median("sideslip_rmse", "joint, gated", case) for case in ("fault", "nearer start")]
    found.append(at_most(GATE, gated[0] / gated[1], 1.2))
    # The bound of mu over the prior's standard deviation; infinite if no wheel slides.
    smallest = min(float(one.bounds.friction / one.spread.friction) for one in result.seen["known"][0])
    found.append(above(SMALL_STEER, smallest, 1.0))
    return with_terms(found, CRITERIA)


def _nees(who: str, case: str, value: float) -> list[Check]:
    (below, over), (low, high) = consistent(who, case), NEES
    return [above(below, value, low), at_most(over, value, high)]


def tables(result: Reproduction) -> list[Table]:
    """The tables; those of the estimators include the first guess, which does nothing."""
    raced = result.raced
    found = [race_table(raced, case) for case in (*STARTS, OTHER)]
    speeds = speed_table(raced, (*STARTS, OTHER))
    return [*found, speeds, _paired_table(raced), _fault_table(raced), _line_table(result), *road_tables(result.roads)]


TITLES = {
    "printed start": "From the printed start mu 1, 700 kg, 1400 kg m^2, 1.0 m",
    "nearer start": "From mu 0.3, 1050 kg, 1500 kg m^2, 1.1 m",
    "other tyres": "The same on tyres with a peak (Magic Formula), which no filter has",
}


def race_table(raced: Raced, case: str) -> Table:
    """Final errors, consistency and sideslip of every estimator in one case."""
    seeds = raced.found.seeds
    rows = []
    whats = contestants(raced.study)
    for name in raced.found.design.axis("estimator").labels:
        at = lambda value, name=name, **options: spread(raced.at(value, name, case), **options)
        errors = [at(f"{parameter}_error", scale=100.0) for parameter in PARAMETERS]
        sure = [at(value, lost="infinite") for value in ("nees", "nees_all")]
        rows.append((name, *errors, *sure, at("sideslip_rmse"), whats[name].what))
    heads = [f"{SHORT[name]}, %" for name in PARAMETERS]
    return Table(
        f"{TITLES[case]}: median [quartiles] over {seeds} seeds",
        ("estimator", *heads, "NEES/4", "NEES/7", "sideslip RMSE, degrees", "what it is"),
        rows,
    )


def _paired_table(raced: Raced) -> Table:
    rows = []
    for name in raced.found.design.axis("estimator").labels:
        cells = []
        for case in ("printed start", "nearer start"):
            own, joint = (raced.at("sideslip_rmse", who, case) for who in (name, "joint"))
            pair = compare(own, joint)
            cells += [interval(pair.ratio), float(pair.wins)]
        rows.append((name, *cells))
    return Table(
        "Sideslip RMSE over the joint filter's, seed by seed: median ratio [95 %], share of seeds in which it is smaller",
        ("estimator", "printed start", "wins", "nearer start", "wins"),
        rows,
    )


def _fault_table(raced: Raced) -> Table:
    rows = []
    for name in raced.found.design.axis("estimator").labels:
        without, with_fault = (raced.at("sideslip_rmse", name, case) for case in ("nearer start", "fault"))
        during = raced.at("sideslip_rmse_fault", name, "fault")
        errors = [spread(raced.at(f"{p}_error", name, "fault"), scale=100.0) for p in ("friction", "yaw_inertia")]
        rows.append(
            (name, spread(without), spread(with_fault), spread(during), _median(with_fault) / _median(without), *errors)
        )
    study = raced.study
    return Table(
        f"Yaw rate off by {study.bias:g} rad/s for {study.fault_time:g} s: sideslip RMSE in degrees",
        ("estimator", "no fault", "with the fault", "during the fault", "ratio of medians", "mu, %", "I_z, %"),
        rows,
    )


def _line_table(result: Reproduction) -> Table:
    rows = []
    for i, steer in enumerate(result.steers):
        for j, speed in enumerate(result.spreads):
            known, unknown = (result.seen[name][i][j] for name in ("known", "unknown"))
            mu, m = (result.over[f"{name}_error"][i, j] for name in ("friction", "mass"))
            mu_bound = "unobservable" if "friction" in known.unobservable() else 100.0 * known.bounds.friction
            rows.append(
                (f"{steer:g}", speed, mu_bound, spread(mu, scale=100.0), 100.0 * known.bounds.mass,
                 100.0 * unknown.bounds.mass, spread(m, scale=100.0))
            )  # fmt: skip
    return Table(
        "Information in steer and speed: Cramer-Rao bounds in % (at the truth), and the joint filter's final errors in %",
        (
            "steer, degrees",
            "speed varied by, m/s",
            "bound of mu",
            "found",
            "bound of m",
            "rolling resistance unknown",
            "found",
        ),
        rows,
    )
