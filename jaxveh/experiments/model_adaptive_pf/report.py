"""The report: an ablation, the effect of an error of the tyre, and the criteria."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.model_adaptive_pf.beside import FEW, SLOWLY, beside_table, entrants, six_table, slow_table
from jaxveh.experiments.model_adaptive_pf.contestants import (
    JUDGED,
    PLAIN,
    REDESIGNED,
    ROBUST,
    TOLD,
    contestants,
)
from jaxveh.experiments.model_adaptive_pf.criteria import ASKED, CRITERIA, NOTHING, TOLD_LENGTH, Asked
from jaxveh.experiments.model_adaptive_pf.drives import Drive
from jaxveh.experiments.model_adaptive_pf.settings import CASES, LIMIT, PROCESS, SLOW, SWERVE, WRONG_LENGTHS, Study
from jaxveh.experiments.model_adaptive_pf.study import Raced, drives_of, race
from jaxveh.experiments.report import Check, at_most, interval, spread, with_terms
from jaxveh.sweeps import IN_MEMORY, Comparison, Stores, Table, compare

ERRORS = {"sideslip": "sideslip, degrees", "v_y": "v_y, m/s", "yaw_rate": "yaw rate, degrees/s"}


PRESSED = ("open loop", PLAIN, REDESIGNED, ROBUST, TOLD)
"""The estimators that run with every process noise."""

DENSITIES = (PLAIN, REDESIGNED, ROBUST)
"""Those of them whose likelihoods use the same data: the one that is told the noise leaves rows out."""


class Reproduction(NamedTuple):
    """All results of the experiment: `raced`, every case and estimator; `pressed`, some estimators by their process noise;
    the estimators of the criteria on tyres without relaxation, `unaware`, and told half or twice its length, `misled`;
    further parts of the paper, `beside`; and runs at 30 km/h and on a loose road, `slow`."""

    seeds: int
    raced: Raced
    pressed: Raced
    unaware: Raced
    misled: Raced
    beside: Raced
    slow: Raced


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
    # Other drives than those on which the noises were chosen, which had another key.
    drive_key, filter_key = jax.random.split(jax.random.fold_in(jax.random.key(seed), 1))
    cases = {**CASES, **LIMIT, **SLOW}
    drives = drives_of(study, cases, seeds, drive_key, progress=part(progress, 0.0, 0.15, "drives"), stores=stores)
    on = lambda *names: _drives_on(drives, cases, names)
    own = {name: cases[name] for name in (*CASES, *LIMIT)}
    raced = race(study, own, on(*own), filter_key, progress=part(progress, 0.15, 0.6, "filters"), stores=stores)
    first = lambda *names: jax.tree.map(lambda leaf: leaf[:, :FEW], on(*names))
    beside = race(
        study, SWERVE, first(*SWERVE), filter_key, entrants=entrants(study),
        progress=part(progress, 0.6, 0.65, "further parts of the paper"), stores=stores.under("beside"),
    )  # fmt: skip
    slow = race(
        study, SLOW, first(*SLOW), filter_key, only=SLOWLY, progress=part(progress, 0.65, 0.7, "30 km/h"),
        stores=stores.under("slow"),
    )  # fmt: skip
    pressed = race(
        study, PROCESS, on(*["both"] * len(PROCESS)), filter_key, only=PRESSED,
        progress=part(progress, 0.7, 0.8, "process noise"), stores=stores.under("process-noise"),
    )  # fmt: skip
    same = {name: CASES[name] for name in ("constant", "both")}
    unaware = race(
        study, same, on(*same), filter_key, only=JUDGED, entrants=contestants(study, lags=False),
        progress=part(progress, 0.8, 0.9, "no relaxation known"), stores=stores.under("no-relaxation"),
    )  # fmt: skip
    misled = race(
        study, WRONG_LENGTHS, on(*[name.split(",")[0] for name in WRONG_LENGTHS]), filter_key, only=JUDGED,
        progress=part(progress, 0.9, 1.0, "wrong relaxation lengths"), stores=stores.under("wrong-lengths"),
    )  # fmt: skip
    progress(1.0, 1.0, "done")
    return Reproduction(seeds, raced, pressed, unaware, misled, beside, slow)


def _drives_on(drives: Drive, cases: dict[str, Any], names: tuple[str, ...]) -> Drive:
    """The drives of some cases, (names, seeds, T)."""
    places = [list(cases).index(name) for name in names]
    return Drive(*(np.asarray(leaf)[places] for leaf in drives))


def against(raced: Raced, case: str, estimator: str, other: str = PLAIN, error: str = "sideslip") -> Comparison:
    """An estimator's errors compared with another's, seed by seed."""
    return compare(raced.of(error, estimator, case), raced.of(error, other, case))


def check(result: Reproduction) -> list[Check]:
    """The criteria, each with its condition (`criteria`).

    That the error was made before the wavelet had the noise level was found on drives of another key; the remedy was chosen
    by likelihood on those of a third (`choice`). Drives differ: over 40 of the other key the redesigned filter, told the
    relaxation length, has 0.78 times the error of the plain one and the robust one 0.75 times, while a cubature filter that
    is told the noise reaches 0.73 (on the report's drives 0.68).
    """
    return with_terms([at_most(one.name, value_of(result, one), one.question.bound) for one in ASKED], CRITERIA)


def value_of(result: Reproduction, one: Asked) -> float:
    """A criterion's number; with two wrong lengths the worse one."""
    case, _, _, other, _, loses = one.question
    if one.knows == TOLD_LENGTH:
        there = [(result.raced, case)]
    elif one.knows == NOTHING:
        there = [(result.unaware, case)]
    else:
        there = [(result.misled, name) for name in result.misled.cases if name.startswith(case)]
    found = [against(raced, where, one.contestant, other) for raced, where in there]
    return max(float(1.0 - each.wins if loses else each.of_medians.value) for each in found)


def tables(result: Reproduction) -> list[Table]:
    """The tables; each contains the open loop, which does nothing."""
    raced = result.raced
    return [
        _ablation(raced, "both"),
        *(_errors_table(raced, "both", error) for error in ("v_y", "yaw_rate")),
        *(six_table(raced, case) for case in SWERVE),
        beside_table(raced, result.beside),
        slow_table(raced, result.slow),
        _ratios(raced, CASES, "Sideslip RMSE over the plain particle filter's, by noise"),
        _knowledge(result, "both"),
        _knowledge(result, "constant"),
        _noise_table(result.pressed),
        _absolute(raced, LIMIT, "Near the limit, noise as in 'both': sideslip RMSE in degrees, by the filter's tyre"),
        _ratios(raced, LIMIT, "The same over the plain particle filter's: an error of the model dominates"),
    ]


def _seeds(raced: Raced) -> int:
    return raced.found.seeds


def _names(raced: Raced) -> tuple[str, ...]:
    return raced.found.design.axis("estimator").labels


def _ablation(raced: Raced, case: str) -> Table:
    rows = []
    for name, contestant in contestants(raced.study).items():
        errors = [spread(raced.of(error, name, case)) for error in ERRORS]
        found = against(raced, case, name)
        rows.append((name, *errors, interval(found.ratio), 100.0 * float(found.wins), contestant.what))
    return Table(
        f"Scenario '{case}': RMSE, median [quartiles] over {_seeds(raced)} seeds; paired ratio of sideslip to the {PLAIN}'s "
        "[95 % bootstrap interval]",
        ("estimator", *ERRORS.values(), f"sideslip over {PLAIN}'s", f"beats {PLAIN}, % of seeds", "what it is"),
        rows,
    )


def _errors_table(raced: Raced, case: str, error: str) -> Table:
    rows = []
    for name in _names(raced):
        found = against(raced, case, name, error=error)
        rows.append((name, spread(raced.of(error, name, case)), interval(found.ratio), 100.0 * float(found.wins)))
    return Table(
        f"Scenario '{case}': {ERRORS[error].split(',')[0]}",
        ("estimator", f"RMSE, {ERRORS[error].split(', ')[1]}", f"over {PLAIN}'s", f"beats {PLAIN}, % of seeds"),
        rows,
    )


def _ratios(raced: Raced, cases, title: str) -> Table:
    rows = [
        (name, *[interval(against(raced, case, name).ratio) for case in cases]) for name in _names(raced)
    ]  # fmt: skip
    return Table(title, ("estimator", *cases), rows)


def _absolute(raced: Raced, cases, title: str) -> Table:
    rows = [(name, *[spread(raced.of("sideslip", name, case)) for case in cases]) for name in _names(raced)]
    return Table(title, ("estimator", *cases), rows)


def _knowledge(result: Reproduction, case: str) -> Table:
    """Errors by what filters are told of the relaxation length."""
    there = {
        "nothing": (result.unaware, case),
        "half of it": (result.misled, f"{case}, half"),
        "the length": (result.raced, case),
        "twice of it": (result.misled, f"{case}, double"),
    }
    rows = []
    for name in JUDGED:
        cells = [spread(raced.of("sideslip", name, where)) for raced, where in there.values()]
        ratios = [float(against(raced, where, name).of_medians.value) for raced, where in there.values()]
        rows.append((name, *cells, *ratios))
    return Table(
        f"Scenario '{case}' by what all filters are told of the tyres' relaxation length: sideslip RMSE, degrees; and medians "
        f"over those of the {PLAIN} that is told the same",
        ("estimator", *there, *[f"over {PLAIN}: {what}" for what in there]),
        rows,
    )


def _noise_table(raced: Raced) -> Table:
    rows = []
    for name in _names(raced):
        errors = [spread(raced.of("sideslip", name, case)) for case in raced.cases]
        chosen = likeliest(raced, name) if name in DENSITIES else "-"
        rows.append((name, *errors, chosen))
    return Table(
        "Scenario 'both' by the process noise, over that of the other tables: sideslip RMSE, degrees; and the process noise that "
        "each would choose on these drives by its own likelihood",
        ("estimator", *raced.cases, "its own choice"),
        rows,
    )


def likeliest(raced: Raced, estimator: str) -> str:
    """The case with the greatest likelihood of the estimator, summed over all drives; a lost drive has none."""

    def total(case: str) -> float:
        values = raced.of("log_likelihood", estimator, case)
        return float(np.sum(np.where(np.isfinite(values), values, -np.inf)))

    return max(raced.cases, key=total)


def settings(result: Reproduction) -> dict[str, Any]:
    """The study and its cases, for the manifest."""
    raced = result.raced
    return {
        "study": dataclasses.asdict(raced.study),
        "cases": {
            name: case._asdict()
            for name, case in {
                **raced.cases,
                **result.pressed.cases,
                **result.misled.cases,
                **result.slow.cases,
            }.items()
        },
    }
