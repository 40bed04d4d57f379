"""The report: the review's circles and crosses as numbers, its claims, a real log, and the checks."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax

from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.report import Check, Table, at_most, interval, spread
from jaxveh.experiments.sideslip_review.contestants import WHAT
from jaxveh.experiments.sideslip_review.printed import equations
from jaxveh.experiments.sideslip_review.recorded import BEST, READY, SMOOTHED, Logged, on_log
from jaxveh.experiments.sideslip_review.settings import SCENARIOS, Study
from jaxveh.experiments.sideslip_review.study import Raced, drives_of, race
from jaxveh.experiments.sideslip_review.verdicts import BANK, ROWS, claims, limit_of, number, verdicts
from jaxveh.sweeps import compare

FIRST = next(iter(WHAT))
"""The baseline."""


class Reproduction(NamedTuple):
    """Everything the experiment found: the simulated drives, and the real log (None: none was given)."""

    seeds: int
    raced: Raced
    logged: Logged | None


def run(
    study: Study | None = None,
    *,
    seeds: int = 20,
    seed: int = 0,
    log: Any = None,
    car: Any = None,
    progress: Progress = silent,
) -> Reproduction:
    """All drives and methods over `seeds` seeds (at least two).

    `log` and `car`: a recording with `steer`, `v_x`, `a_x`, `a_y`, `yaw_rate` and, to score against, `v_y`, and the car's
    specification; or their paths. Without them the real log is left out.
    """
    study = study or Study()
    share = 1.0 if log is None else 0.6
    # Other drives than those on which the noises were chosen.
    key = jax.random.fold_in(jax.random.key(seed), 1)
    drives = drives_of(study, seeds, key, progress=part(progress, 0.0, 0.25 * share, "drives"))
    raced = race(study, drives, progress=part(progress, 0.25 * share, share, "methods"))
    logged = None if log is None else on_log(study, log, car, progress=part(progress, share, 1.0, "log"))
    progress(1.0, 1.0, "done")
    return Reproduction(seeds, raced, logged)


def check(result: Reproduction) -> list[Check]:
    """The criteria; nobody knew the truth. Without a log the last one cannot be looked at and is left out."""
    raced = result.raced
    failed = sum(float(values["failed"].sum()) for values in raced.found.values())
    count = len(raced.found) * len(raced.scenarios) * result.seeds
    undecided = sum(not cell.verdict for cell in verdicts(raced))
    found = [
        at_most(f"runs that failed, of {count}", failed, 0),
        at_most("cells of the review's table without a verdict", undecided, 0),
    ]
    if result.logged is not None:
        rmse, best = result.logged.rmse, result.logged.best
        found.append(at_most(f"real log, {best}: sideslip RMSE, degrees (bound: the library's best)", rmse[best], BEST))
        found.append(at_most(f"real log, {SMOOTHED}: the same with hindsight", rmse[SMOOTHED], BEST))
    return found


def tables(result: Reproduction) -> list[Table]:
    """The tables, the open loop in each that ranks methods."""
    return [
        _verdict_table(result),
        _mark_table(result),
        _claim_table(result),
        _error_table(result, "early", "in the beginning"),
        _error_table(result, "late", "at the end"),
        _against_open_loop(result),
        _log_table(result),
        equations(),
    ]


def as_printed(*, seeds: int = 20, seed: int = 0, progress: Progress = silent) -> list[Table]:
    """The review's own equations as printed and as they should be; nothing in them is random."""
    del seeds, seed
    progress(1.0, 1.0, "done")
    return [equations()]


def settings(result: Reproduction) -> dict[str, Any]:
    """The study, the scenarios and the fitted noises of the log."""
    found = {"study": dataclasses.asdict(result.raced.study)}
    found["scenarios"] = {name: dataclasses.asdict(one) for name, one in SCENARIOS.items()}
    if result.logged is not None:
        found["log"] = {"source": result.logged.source, "noise": dataclasses.asdict(result.logged.noise)}
    return found


def _verdict_table(result: Reproduction) -> Table:
    rows = [
        (
            one.row,
            one.method,
            "o" if one.mark else "x",
            interval(one.found, 2),
            f"<= {one.limit:g}",
            one.verdict,
            ROWS[one.row].what,
        )
        for one in verdicts(result.raced)
    ]
    return Table(
        f"The review's table: median over {result.seeds} seeds [95 % of bootstrap]",
        ("row", "method", "review", "number", "good is", "verdict", "the number is"),
        rows,
    )


def _mark_table(result: Reproduction) -> Table:
    """What the same rules make of every method."""
    rows = []
    for name in WHAT:
        cells = [interval(number(result.raced, one, name), 2) for one in (*ROWS.values(), BANK)]
        rows.append((name, *cells))
    limits = [f"<= {limit_of(result.raced.study, one):g}" for one in (*ROWS.values(), BANK)]
    return Table("The same numbers of every method", ("method", *ROWS, "robust to bank"), [("good is", *limits), *rows])


def _claim_table(result: Reproduction) -> Table:
    words = lambda side: f"{side[1]}, {side[2]}"
    rows = [(c.text, words(c.a), words(c.b), interval(ratio, 2), verdict) for c, ratio, verdict in claims(result.raced)]
    return Table(
        "What the text says: errors of one over the other's, on the same seeds",
        ("claim", "of", "over", "ratio", "verdict"),
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
    rows = [(name, logged.rmse[name], logged.rmse[name] / BEST, WHAT.get(name, "")) for name in order]
    return Table(
        f"Real log, {logged.rows} rows that nothing was fitted to: {logged.source}",
        ("method", "sideslip RMSE, degrees", f"over {BEST:g}", "what it is"),
        rows,
    )
