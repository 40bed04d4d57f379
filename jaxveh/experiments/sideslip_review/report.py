"""The report: the review's circles and crosses as numbers, its claims, a real log, and the checks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax

from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.report import Check, at_most, interval, leave_open, spread, with_terms
from jaxveh.experiments.sideslip_review.chapters import (
    ChaptersRaced,
    chapter_drives,
    chapter_tables,
    conclusion_table,
    race_methods,
)
from jaxveh.experiments.sideslip_review.contestants import WHAT
from jaxveh.experiments.sideslip_review.criteria import (
    CELLS,
    CELLS_FAST,
    CRITERIA,
    LOG,
    LOG_CROSSED,
    LOG_SMOOTHED,
    RUNS,
)
from jaxveh.experiments.sideslip_review.printed import equations
from jaxveh.experiments.sideslip_review.recorded import BEST, READY, SMOOTHED, Logged, on_log
from jaxveh.experiments.sideslip_review.settings import SCENARIOS, Study
from jaxveh.experiments.sideslip_review.study import Raced, drives_of, race
from jaxveh.experiments.sideslip_review.verdicts import (
    BANK,
    BETTER,
    FIRST_ROWS,
    OPEN,
    ROWS,
    Statistic,
    claims,
    limit_of,
    number,
    verdicts,
)
from jaxveh.sweeps import IN_MEMORY, Stores, Table, compare

FIRST = next(iter(WHAT))
"""The baseline."""

CHAPTER_SEEDS, CHAPTER_DURATION = 6, 40.0
"""Most seeds of the chapters, whose cars take fifty times as long, and s of a drive."""


class Reproduction(NamedTuple):
    """All results of the experiment: the simulated drives (`raced`), the real log (`logged`; None if none was given), and
    the `chapters` (None if left out)."""

    seeds: int
    raced: Raced
    logged: Logged | None
    chapters: ChaptersRaced | None = None


def run(
    study: Study | None = None,
    *,
    seeds: int = 20,
    seed: int = 0,
    log: Any = None,
    car: Any = None,
    chapters: bool = True,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Reproduction:
    """All drives and methods over `seeds` seeds (at least two).

    `log` and `car`: a recording with `steer`, `v_x`, `a_x`, `a_y`, `yaw_rate` and, to score against, `v_y`, and the car's
    specification; or their paths. Without them the real log is left out. `chapters`: also every method of `jaxveh.estimators` in
    every scenario, over at most `CHAPTER_SEEDS` seeds.
    """
    study = study or Study()
    whole, progress = progress, part(progress, 0.0, 0.3 if chapters else 1.0, "race")
    share = 1.0 if log is None else 0.6
    # Other drives than those on which the noises were chosen.
    key = jax.random.fold_in(jax.random.key(seed), 1)
    drives = drives_of(study, seeds, key, progress=part(progress, 0.0, 0.25 * share, "drives"), stores=stores)
    told = part(progress, 0.25 * share, share, "methods")
    raced = race(study, drives, jax.random.key(seed), progress=told, stores=stores)
    logged = None if log is None else on_log(study, log, car, progress=part(progress, share, 1.0, "log"))
    found = _chapters(seeds, seed, part(whole, 0.3, 1.0, "chapters"), stores.under("chapters")) if chapters else None
    whole(1.0, 1.0, "done")
    return Reproduction(seeds, raced, logged, found)


def _chapters(seeds: int, seed: int, progress: Progress, stores: Stores) -> ChaptersRaced:
    few = min(seeds, CHAPTER_SEEDS)
    key = jax.random.fold_in(jax.random.key(seed), 2)
    told = part(progress, 0.0, 0.3, "drives")
    drives = chapter_drives(few, key, duration=CHAPTER_DURATION, progress=told, stores=stores)
    return race_methods(drives, few, key, progress=part(progress, 0.3, 1.0, "methods"), stores=stores)


def check(result: Reproduction) -> list[Check]:
    """The criteria, each with its condition (`criteria`). Those of a log stay open if no log was given."""
    raced = result.raced
    failed = sum(float(values["failed"].sum()) for values in raced.found.values())
    cells = [_cells(CELLS, raced, FIRST_ROWS), _cells(CELLS_FAST, raced, ROWS)]
    return with_terms([at_most(RUNS, failed, 0), *cells, *_log_checks(result.logged)], CRITERIA)


def _cells(name: str, raced: Raced, rows: Mapping[str, Statistic]) -> Check:
    """The number of cells that are neither supported nor contradicted; a cell without a number is a failure."""
    found = [cell.verdict for cell in verdicts(raced, rows)]
    check = at_most(name, sum(verdict in (OPEN, "") for verdict in found), 0)
    return check if check.holds or "" in found else leave_open(check)


def _log_checks(logged: Logged | None) -> list[Check]:
    if logged is None:
        return [leave_open(at_most(name, float("nan"), BEST)) for name in (LOG, LOG_CROSSED, LOG_SMOOTHED)]
    least = at_most(LOG, logged.rmse[logged.best], BEST)
    return [
        # The least of many on the rows that score it: a larger value is a result, a smaller one is not.
        leave_open(least) if least.holds else least,
        at_most(LOG_CROSSED, logged.crossed_rmse, BEST),
        at_most(LOG_SMOOTHED, logged.rmse[SMOOTHED], BEST),
    ]


def tables(result: Reproduction) -> list[Table]:
    """The tables; those that rank methods include the open loop."""
    return [
        _verdict_table(result, FIRST_ROWS, "statistics as set before numbers were seen"),
        _verdict_table(result, ROWS, "transients by the fast part alone, as decided after a first look"),
        _mark_table(result),
        _claim_table(result),
        _error_table(result, "early", "in the beginning"),
        _error_table(result, "late", "at the end"),
        _against_open_loop(result),
        _log_table(result),
        equations(),
        *([] if result.chapters is None else [*chapter_tables(result.chapters), conclusion_table(result.chapters)]),
    ]


def as_printed(
    *, seeds: int = 20, seed: int = 0, progress: Progress = silent, stores: Stores = IN_MEMORY
) -> list[Table]:
    """The review's own equations as printed and corrected; nothing in them is random."""
    del seeds, seed, stores
    progress(1.0, 1.0, "done")
    return [equations()]


def settings(result: Reproduction) -> dict[str, Any]:
    """The study, the scenarios and the fitted noises of the log."""
    found = {"study": dataclasses.asdict(result.raced.study)}
    found["scenarios"] = {name: dataclasses.asdict(one) for name, one in SCENARIOS.items()}
    if result.logged is not None:
        found["log"] = {"source": result.logged.source, "noise": dataclasses.asdict(result.logged.noise)}
    return found


def _verdict_table(result: Reproduction, statistics: Mapping[str, Statistic], rule: str) -> Table:
    rows = [
        (
            one.row,
            one.method,
            "o" if one.mark else "x",
            interval(one.found, 2),
            f"<= {one.limit:g}",
            one.verdict,
            one.statistic.what,
        )
        for one in verdicts(result.raced, statistics)
    ]
    return Table(
        f"The review's table, {rule}: median over {result.seeds} seeds [95 % of bootstrap]",
        ("row", "method", "review", "number", "good is", "verdict", "the number is"),
        rows,
    )


def _mark_table(result: Reproduction) -> Table:
    """The numbers of the same statistics for every method."""
    rows = []
    for name in WHAT:
        cells = [interval(number(result.raced, one, name), 2) for one in (*ROWS.values(), BANK)]
        rows.append((name, *cells))
    limits = [f"<= {limit_of(result.raced.study, one):g}" for one in (*ROWS.values(), BANK)]
    return Table("The same numbers of every method", ("method", *ROWS, "robust to bank"), [("good is", *limits), *rows])


def _claim_table(result: Reproduction) -> Table:
    words = lambda side: f"{side[1]}, {side[2]}"
    rows = [
        (one.claim.text, words(one.claim.a), words(one.claim.b), interval(one.ratio, 2), one.verdict, one.by_any_lead)
        for one in claims(result.raced)
    ]
    return Table(
        f"The claims of the text: errors of one method over the other's, on the same seeds; better is below {BETTER:g}, decided "
        "after a first look, and at first any lead",
        ("claim", "of", "over", "ratio", "verdict", "verdict at first"),
        rows,
    )


def _error_table(result: Reproduction, metric: str, when: str) -> Table:
    raced = result.raced
    rows = [("sideslip itself", *[spread(raced.at(f"of_{metric}", FIRST, s)) for s in raced.scenarios], "")]
    for name, what in WHAT.items():
        rows.append((name, *[spread(raced.at(metric, name, s)) for s in raced.scenarios], what))
    return Table(
        f"Sideslip RMSE in degrees, {when}: median [quartiles]", ("method", *raced.scenarios, "what it is"), rows
    )


def _against_open_loop(result: Reproduction) -> Table:
    """Paired with the open loop on the same seeds: ratio and wins."""
    raced, rows = result.raced, []
    for name in WHAT:
        cells = []
        for scenario in raced.scenarios:
            found = compare(raced.at("early", name, scenario), raced.at("early", FIRST, scenario))
            cells.append(f"{interval(found.ratio, 2)}, {100 * float(found.wins):.0f} %")
        rows.append((name, *cells))
    return Table("Error over the open loop's, and how often it is smaller", ("method", *raced.scenarios), rows)


def _log_table(result: Reproduction) -> Table:
    logged = result.logged
    if logged is None:
        return Table("Real log: none was given (log=, car=)", ("method", "sideslip RMSE, degrees"), [])
    order = (*READY, *(name for name in logged.rmse if name not in READY))
    chosen = f"{logged.choices[0]}; {logged.choices[1]}"
    rows = [
        *(
            (name, logged.rmse[name], logged.rmse[name] / BEST, *logged.halves[name], WHAT.get(name, ""))
            for name in order
        ),
        ("the other half's choice", logged.crossed_rmse, logged.crossed_rmse / BEST, *_crossed_rmse(logged), chosen),
    ]
    return Table(
        f"Real log, {logged.rows} rows to which nothing was fitted: {logged.source}",
        ("method", "sideslip RMSE, degrees", f"over {BEST:g}", "first half", "second half", "what it is"),
        rows,
    )


def _crossed_rmse(logged: Logged) -> list[float]:
    return [logged.halves[name][i] for i, name in enumerate(logged.choices)]
