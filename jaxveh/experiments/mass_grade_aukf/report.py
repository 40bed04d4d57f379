"""The report: tables, checks against honest criteria, and what the printed numbers rest on."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.mass_grade_aukf.contestants import contestants
from jaxveh.experiments.mass_grade_aukf.drives import Drive, disturbed, drive_once
from jaxveh.experiments.mass_grade_aukf.observed import Known, known_of_mass
from jaxveh.experiments.mass_grade_aukf.settings import CAR, GRADE_RMSE, TABLE_1, Study, car, truck
from jaxveh.experiments.mass_grade_aukf.study import Raced, drives_of, race
from jaxveh.experiments.report import Check, Table, above, at_most, spread

PEDALS = (0.0, 0.03, 0.1)
"""Pedal activities, m/s^2; the last is that of the checks."""

LATE = 0.1
"""s by which the torque's signal is late in one of the disturbances."""

OFFSET = 0.01
"""m/s^2 of the accelerometer in another."""

AIDED = ("grade rate", "accelerometer", "accelerometer with bias")


class Reproduction(NamedTuple):
    """Everything the experiment found: `truck` with every pedal activity, `car`, the truck with disturbances by name, and what a
    drive of the truck can tell, by what its driver does."""

    seeds: int
    truck: Raced
    car: Raced
    disturbed: dict[str, Raced]
    observed: dict[str, tuple[Known, Known]]


def run(
    truck_study: Study | None = None,
    car_study: Study | None = None,
    *,
    seeds: int = 20,
    seed: int = 0,
    progress: Progress = silent,
) -> Reproduction:
    """All drives and estimators over `seeds` seeds (at least two)."""
    truck_study, car_study = truck_study or truck(), car_study or car()
    # Other drives than those on which the noises were chosen, whose key is that of `seed` itself.
    key = jax.random.fold_in(jax.random.key(seed), 1)
    truck_key, car_key = jax.random.split(key)
    drives = drives_of(truck_study, PEDALS, seeds, truck_key, progress=part(progress, 0.0, 0.3, "truck drives"))
    trucks = race(truck_study, PEDALS, drives, progress=part(progress, 0.3, 0.55, "truck"))
    lively = jax.tree.map(lambda leaf: leaf[-1:], drives)
    late = round(LATE / truck_study.dt)
    changes = {
        f"torque {LATE:g} s late": dict(late=late),
        "torque 2 % too large": dict(scale=1.02),
        f"accelerometer off by {OFFSET:g} m/s^2": dict(offset=OFFSET),
    }
    raced = {}
    for i, (name, change) in enumerate(changes.items()):
        told = part(progress, 0.55 + 0.05 * i, 0.6 + 0.05 * i, name)
        raced[name] = race(truck_study, PEDALS[-1:], disturbed(lively, **change), only=AIDED, progress=told)
    own = drives_of(car_study, PEDALS[-1:], seeds, car_key, progress=part(progress, 0.7, 0.85, "car drives"))
    cars = race(car_study, PEDALS[-1:], own, progress=part(progress, 0.85, 0.95, "car"))
    progress(0.95, 1.0, "observability")
    observed = _observed(truck_study, drives, truck_key)
    progress(1.0, 1.0, "done")
    return Reproduction(seeds, trucks, cars, raced, observed)


def _observed(study: Study, drives: Drive, key) -> dict[str, tuple[Known, Known]]:
    """By what the driver does: what three states can know, and what four."""
    steady = dataclasses.replace(study, speed_std=0.0)
    seen = {"held speed, no pedals": drive_once(steady, 0.0, jax.random.split(key, 2)[0])}
    for i, pedals in enumerate(PEDALS):
        seen[f"pedals {pedals:g} m/s^2"] = Drive(*(jnp.asarray(leaf[i, 0]) for leaf in drives))
    return {name: (known_of_mass(study, drive), known_of_mass(study, drive, True)) for name, drive in seen.items()}


def _of(raced: Raced, name: str, estimator: str, pedals: float | None = None) -> np.ndarray:
    """Values (guesses, seeds)."""
    return raced.found.at(name, estimator=estimator, pedals=raced.pedals[-1] if pedals is None else pedals)


def check(result: Reproduction) -> list[Check]:
    """The criteria: medians over seeds, of the worst first guess; nobody knew the truth."""
    found = []
    for raced, limits in ((result.truck, (1.0, 0.3)), (result.car, (1.0, 0.3))):
        name = raced.study.name
        worst = lambda what, estimator, share=0.5, raced=raced: float(
            np.max(np.quantile(_of(raced, what, estimator), share, axis=-1, method="nearest"))
        )
        for estimator, limit in zip(AIDED[:2], limits, strict=True):
            found.append(
                at_most(f"{name}, {estimator}: final mass error, %", 100 * worst("mass_error", estimator), limit)
            )
        if name == "truck":
            rate, aided = AIDED[:2]
            found.append(
                at_most(f"{name}, {rate}: upper quartile of it, %", 100 * worst("mass_error", rate, 0.75), 2.0)
            )
            found.append(at_most(f"{name}, {rate}: grade RMSE, degrees", worst("grade_rmse", rate), 0.10))
            found.append(at_most(f"{name}, {rate}: within 3 % from then on, s", worst("settled", rate), 60.0))
            found.append(at_most(f"{name}, {aided}: within 3 % from then on, s", worst("settled", aided), 10.0))
    for name, (three, _) in result.observed.items():
        if "no pedals" in name or "pedals 0 " in name:
            found.append(above(f"three states, {name}: error of the mass over what the prior knew", three.share, 1.0))
    return found


def tables(result: Reproduction) -> list[Table]:
    """The tables, the do-nothing first guess in each."""
    return [
        _race_table(result.truck, "Truck"),
        _activity_table(result),
        _guess_table(result),
        _race_table(result.car, "Car with brake touches"),
        _disturbed_table(result),
        _observed_table(result),
    ]


def _race_table(raced: Raced, title: str) -> Table:
    rows = []
    printed = GRADE_RMSE[raced.study.name]
    for name, contestant in contestants(raced.study).items():
        cells = [
            spread(_of(raced, "mass_error", name), scale=100.0),
            spread(_of(raced, "settled", name), lost="never"),
            spread(_of(raced, "grade_rmse", name)),
        ]
        rows.append((name, *cells, printed.get(name.removesuffix(" as printed"), ""), contestant.what))
    guesses, seeds = _of(raced, "mass_error", rows[0][0]).shape
    return Table(
        f"{title}, pedals {raced.pedals[-1]:g} m/s^2: median [quartiles] over {seeds} seeds and {guesses} guess(es)",
        ("estimator", "final mass error, %", "within 3 % from, s", "grade RMSE, degrees", "paper's", "what it is"),
        rows,
    )


def _activity_table(result: Reproduction) -> Table:
    raced = result.truck
    rows = [
        (name, *[spread(_of(raced, "mass_error", name, pedals), scale=100.0) for pedals in raced.pedals])
        for name in contestants(raced.study)
    ]
    heads = [f"pedals {pedals:g} m/s^2" for pedals in raced.pedals]
    return Table("Truck: final mass error in %, by what the pedals do", ("estimator", *heads), rows)


def _guess_table(result: Reproduction) -> Table:
    raced = result.truck
    names = ("AUKF", "grade rate", "accelerometer")
    rows = []
    for i, guess in enumerate(raced.study.guesses):
        mass = [np.median(_of(raced, "mass", name)[i, :, -1]) for name in names]
        rows.append((f"{guess:g}", TABLE_1.get(guess, float("nan")), *[float(m) for m in mass]))
    return Table(
        f"Table 1: final mass in kg by first guess, median over seeds (truth {raced.study.mass:g})",
        ("first guess", "paper's AUKF", *names),
        rows,
    )


def _disturbed_table(result: Reproduction) -> Table:
    rows = [("nothing", *[spread(_of(result.truck, "mass_error", name), scale=100.0) for name in AIDED])]
    for what, raced in result.disturbed.items():
        rows.append((what, *[spread(_of(raced, "mass_error", name), scale=100.0) for name in AIDED]))
    return Table("Truck: final mass error in % where a signal is wrong", ("disturbance", *AIDED), rows)


def _observed_table(result: Reproduction) -> Table:
    rows = []
    for drive, both in result.observed.items():
        for states, known in zip(("three", "four"), both, strict=True):
            cells = (100.0 * known.bound, 100.0 * known.pull, 100.0 * known.noise, known.share, known.verdict)
            rows.append((drive, states, *cells))
    heads = ("Cramer-Rao bound, %", "pull of the grade's prior, %", "noise, %", "error over prior", "the mass is")
    return Table(
        "Truck: what a drive tells of the mass, whoever estimates, where the grade walks (three states) or its rate (four)",
        ("drive", "states", *heads),
        rows,
    )


PRINTED = {"truck from 4000 kg": {"UKF": 5795.0, "AUKF": 5721.0}, "car from 1300 kg": CAR}
"""Final masses as printed, kg."""
