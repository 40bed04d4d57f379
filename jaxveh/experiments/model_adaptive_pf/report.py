"""The report: an ablation, what an error of the tyre does, and the criteria."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.model_adaptive_pf.contestants import (
    CUBATURE,
    PLAIN,
    REDESIGNED,
    ROBUST,
    TOLD,
    contestants,
)
from jaxveh.experiments.model_adaptive_pf.drives import Drive
from jaxveh.experiments.model_adaptive_pf.settings import CASES, LIMIT, PROCESS, Study
from jaxveh.experiments.model_adaptive_pf.study import Raced, drives_of, race
from jaxveh.experiments.report import Check, Table, at_most, interval, spread
from jaxveh.sweeps import Comparison, compare

ERRORS = {"sideslip": "sideslip, degrees", "v_y": "v_y, m/s", "yaw_rate": "yaw rate, degrees/s"}


PRESSED = ("open loop", PLAIN, REDESIGNED, ROBUST, TOLD)
"""Who is tried with every process noise."""

DENSITIES = (PLAIN, REDESIGNED, ROBUST)
"""Of these, whose likelihood is one of the same data: who is told leaves rows out."""


class Reproduction(NamedTuple):
    """Everything the experiment found: `raced`, every case and estimator; `pressed`, some by their process noise."""

    seeds: int
    raced: Raced
    pressed: Raced


def run(study: Study | None = None, *, seeds: int = 20, seed: int = 0, progress: Progress = silent) -> Reproduction:
    """All drives and estimators over `seeds` seeds (at least two)."""
    study = study or Study()
    # Other drives than those on which the noises were chosen, whose key was another.
    drive_key, filter_key = jax.random.split(jax.random.fold_in(jax.random.key(seed), 1))
    cases = {**CASES, **LIMIT}
    drives = drives_of(study, cases, seeds, drive_key, progress=part(progress, 0.0, 0.15, "drives"))
    raced = race(study, cases, drives, key=filter_key, progress=part(progress, 0.15, 0.85, "filters"))
    both = list(cases).index("both")
    same = Drive(*(np.repeat(np.asarray(leaf)[both, None], len(PROCESS), axis=0) for leaf in drives))
    told = part(progress, 0.85, 1.0, "process noise")
    pressed = race(study, PROCESS, same, only=PRESSED, key=filter_key, progress=told)
    progress(1.0, 1.0, "done")
    return Reproduction(seeds, raced, pressed)


def against(raced: Raced, case: str, estimator: str, other: str = PLAIN, error: str = "sideslip") -> Comparison:
    """An estimator's errors beside another's, seed by seed."""
    return compare(raced.of(error, estimator, case), raced.of(error, other, case))


def check(result: Reproduction) -> list[Check]:
    """The criteria: medians over seeds of sideslip RMSE over the plain particle filter's; nobody in them knew the truth.

    That the error was made before the wavelet knew the noise, was found on drives of another key; what is done about it was
    chosen by likelihood on those of a third (`choice`). Drives differ: over 40 of the other key the first ratio is 0.78 and the
    fourth 0.75, where a cubature filter that is told the noise ends at 0.73 (on the report's drives 0.68).
    """
    both = lambda a, b=PLAIN: against(result.raced, "both", a, b)
    ratio = lambda found: found.of_medians.value
    constant = against(result.raced, "constant", REDESIGNED)
    return [
        at_most(f"both: {REDESIGNED} over {PLAIN}", ratio(both(REDESIGNED)), 0.78),
        at_most(f"both: {REDESIGNED} over {CUBATURE}", ratio(both(REDESIGNED, CUBATURE)), 0.4),
        at_most(f"both: {REDESIGNED} loses to {PLAIN}, share of seeds", 1.0 - both(REDESIGNED).wins, 0.1),
        at_most(f"both: {ROBUST} over {PLAIN}", ratio(both(ROBUST)), 0.72),
        at_most(f"constant: {REDESIGNED} over {PLAIN}", ratio(constant), 1.03),
    ]


def tables(result: Reproduction) -> list[Table]:
    """The tables, the do-nothing open loop in each."""
    raced = result.raced
    return [
        _ablation(raced, "both"),
        *(_errors_table(raced, "both", error) for error in ("v_y", "yaw_rate")),
        _ratios(raced, CASES, "Sideslip RMSE over the plain particle filter's, by noise"),
        _pressed(result.pressed),
        _absolute(raced, LIMIT, "Near the limit, noise as in 'both': sideslip RMSE in degrees, by the filter's tyre"),
        _ratios(raced, LIMIT, "The same over the plain particle filter's: where the model errs, it rules"),
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


def _pressed(raced: Raced) -> Table:
    rows = []
    for name in _names(raced):
        errors = [spread(raced.of("sideslip", name, case)) for case in raced.cases]
        chosen = likeliest(raced, name) if name in DENSITIES else "-"
        rows.append((name, *errors, chosen))
    return Table(
        "Scenario 'both' by the process noise, over that of the other tables: sideslip RMSE, degrees; and the one that each "
        "would choose on these drives by its own likelihood",
        ("estimator", *raced.cases, "its own choice"),
        rows,
    )


def likeliest(raced: Raced, estimator: str) -> str:
    """The case under which the estimator's likelihood, all drives together, is greatest; a drive that is lost has none."""

    def total(case: str) -> float:
        values = raced.of("log_likelihood", estimator, case)
        return float(np.sum(np.where(np.isfinite(values), values, -np.inf)))

    return max(raced.cases, key=total)


def settings(result: Reproduction) -> dict[str, Any]:
    """The study and its cases, for the manifest."""
    raced = result.raced
    return {
        "study": dataclasses.asdict(raced.study),
        "cases": {name: case._asdict() for name, case in {**raced.cases, **result.pressed.cases}.items()},
    }
