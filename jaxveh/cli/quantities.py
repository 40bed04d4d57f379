"""`jaxveh estimate --what`: quantities estimated by their methods, side by side, and the error of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from jaxveh import InputError, Recording, estimators, io
from jaxveh._core.errors import check_one_of, check_positive
from jaxveh._core.recording import TRUTH
from jaxveh.cli.blanking import fill_short, with_fill_option
from jaxveh.cli.console import number, progress, results, spread, table
from jaxveh.cli.drives import read_log
from jaxveh.cli.log_errors import check_trusted, read_by
from jaxveh.cli.missing_speed import has_wheels, wants_v_x, with_speed
from jaxveh.cli.output import check_product, check_products, check_report, make_folder, write_numbers
from jaxveh.cli.quantity_options import (
    QUANTITIES,
    USUAL_FILTER,
    USUAL_PARTICLES,
    inputs_of,
    methods_of,
    names_of,
    tell_assumed,
)
from jaxveh.cli.several_logs import SeveralLogs
from jaxveh.cli.vehicle import car_of
from jaxveh.diagnostics import LogFinding
from jaxveh.estimators import Answers, Compared, MethodScore
from jaxveh.io import CarSpecification

NOTHING = "nothing done"

SPEED = "speed"

ALIKE = {"v_y": ("v_y", "sideslip"), "sideslip": ("v_y", "sideslip"), "speed": ("speed", "v_x"), "v_x": ("v_x",)}
"""Channels that reveal the truth of a quantity: they are hidden from every method."""


class Asked(NamedTuple):
    """The options of `estimate` that apply to quantities; `methods` is None for the recommended methods."""

    logs: list[Path]
    product: Path
    vehicle: Path | None
    channels: Path | None
    span: str | None
    fill: float | None
    what: tuple[str, ...]
    methods: tuple[str, ...] | None
    truth: str | None
    out: Path | None
    force: bool
    anyway: bool
    live: bool


class Told(NamedTuple):
    """A log: what the methods may have `seen` of it, the whole `recording`, and the findings of its check."""

    log: Path
    seen: Recording
    recording: Recording
    findings: Sequence[LogFinding]


class Shown(NamedTuple):
    """The result for one quantity and one log: the compared methods, and their scores by method and name.

    `nothing` is the RMSE of the do-nothing baseline, by name.
    """

    compared: Compared
    scores: dict[str, dict[str, MethodScore]]
    nothing: dict[str, float]


def quantities_asked(choice: Any, what: str, methods: str | None) -> Asked | None:
    """Return the request in `choice`, the options of `estimate`; None if it is for sideslip by its own program.

    **Raises** `InputError` for an unknown quantity or method, or an option that only the sideslip program has.
    """
    quantities = names_of(what, "--what", tuple(QUANTITIES))
    if quantities == (estimators.sideslip.NAME,) and methods is None:
        return None
    others = {
        "--calibration": choice.calibration, "--calibrate": choice.calibrate, "--calibrate-on": choice.calibrate_on,
        "--report": choice.report, "--as-told": choice.as_told, "--filter": choice.filter.value != USUAL_FILTER,
        "--particles": choice.particles != USUAL_PARTICLES,
    }  # fmt: skip
    given = [option for option, value in others.items() if value]
    if given:
        raise InputError(f"{', '.join(given)}: only for --what sideslip without --methods; leave it out.")
    return Asked(
        choice.logs, choice.product, choice.vehicle, choice.channels, choice.span, choice.fill, quantities,
        methods_of(methods, quantities), choice.truth, choice.out, choice.force, choice.anyway,
        choice.live,
    )  # fmt: skip


def estimate_quantities(asked: Asked, numbers: Path | None) -> None:
    """Estimate the requested quantities along each log, then print, draw and write the results."""
    check_report(asked.out, numbers)
    products, car = _check(asked)
    several = SeveralLogs(asked.logs)
    told = several.each(lambda log: _log(asked, log, car), {log: log for log in asked.logs})
    channels = {name for one in told.values() for name in one.seen.names}
    tell_assumed(asked.what, asked.methods, asked.vehicle, car, channels)
    with progress("estimate") as report:

        def work(one: Told) -> dict[str, Shown]:
            report(asked.logs.index(one.log), len(asked.logs), f"estimating along {one.log.name} (compiling first)")
            own = _logs(asked, one, car)
            return {name: _one(asked, QUANTITIES[name], car, own[name], one) for name in asked.what}

        shown = several.each(work, told)
    pairs = {log: (told[log], products[log], one) for log, one in shown.items()}
    found = several.each(lambda pair: _conclude(asked, *pair), pairs)
    several.check_some()
    by_name = {log.name: one for log, one in found.items()}
    content = {"logs": by_name, "refused": several.reasons()} if len(asked.logs) > 1 else next(iter(by_name.values()))
    configuration = {name: value for name, value in asked._asdict().items() if name not in ("product", "out", "force")}
    write_numbers(numbers, content, configuration, None)
    several.conclude()


def _check(asked: Asked) -> tuple[dict[Path, Path], CarSpecification]:
    """Return the files to write by log, and the car; raise `InputError` if a file could not be written, or options conflict."""
    sources = (*asked.logs, asked.vehicle, asked.channels)
    if asked.vehicle is None:
        raise InputError("--vehicle is missing: give the car's file (jaxveh schema car).")
    if asked.fill is not None:
        check_positive("--fill", asked.fill, "s")
    shown = {name for quantity in asked.what for name in QUANTITIES[quantity].SHOWN}
    if asked.truth is not None:
        check_one_of("--truth", asked.truth.removeprefix(TRUTH), sorted(shown))
    if len(asked.logs) == 1:
        check_product(asked.product, io.SUFFIXES, asked.force, sources)
        return {asked.logs[0]: asked.product}, car_of(asked.vehicle)
    products = [asked.product / f"{log.stem}.parquet" for log in asked.logs]
    check_products(asked.product, products, asked.force, sources)
    return dict(zip(asked.logs, products, strict=True)), car_of(asked.vehicle)


def _log(asked: Asked, log: Path, car: CarSpecification) -> Told:
    """Read a log, and hide its truth and the channels that reveal it from the methods."""

    def reads(recording: Recording) -> set[str]:
        every = {name: asked.methods or (QUANTITIES[name].RECOMMENDED,) for name in asked.what}
        return {
            one for q, names in every.items() for name in names for one in read_by(QUANTITIES[q], name, car, recording)
        }

    drive = read_log(log, car, asked.channels, asked.span, asked.truth, reads, asked.anyway)
    recording = drive.recording
    hidden = set()
    if asked.truth is not None:
        if asked.truth not in recording:
            raise InputError(
                f"--truth {asked.truth}: {log.name} has no such channel; it has: {', '.join(recording.names)}."
            )
        hidden = {asked.truth, *ALIKE.get(asked.truth.removeprefix(TRUTH), (asked.truth.removeprefix(TRUTH),))}
    seen = _filled(asked, recording.without(*[name for name in recording.names if name in hidden]), car)
    return Told(log, seen, recording, drive.findings)


def _filled(asked: Asked, recording: Recording, car: CarSpecification) -> Recording:
    """Fill gaps in the inputs if `--fill` is given."""
    for name in inputs_of(asked.what, asked.methods, car) if asked.fill else ():
        if name in recording:
            recording = fill_short(recording, name, asked.fill)
    return recording


def _logs(asked: Asked, told: Told, car: CarSpecification) -> dict[str, Recording]:
    """Return the log that each quantity sees: with `v_x` from the wheels, except for the speed itself; from the speed over
    ground only for methods that do not use that, too, as a measurement of its own."""
    seen = told.seen
    wants = lambda quantity: wants_v_x(quantity, asked.methods or (quantity.RECOMMENDED,), car)
    wanting = {name for name in asked.what if name != SPEED and (has_wheels(seen) or wants(QUANTITIES[name]))}
    driven = _filled(asked, with_speed(told.log, seen, car), car) if wanting else seen
    return {name: driven if name in wanting else seen for name in asked.what}


def _one(asked: Asked, quantity: ModuleType, car: CarSpecification, own: Recording, told: Told) -> Shown:
    """Estimate one quantity along one log, of which it sees `own`.

    Of several quantities or all methods, those that the log does not allow are listed as refused; others raise.
    """
    compared = _compared(asked, quantity, car, own, told)
    if asked.truth is None or asked.truth.removeprefix(TRUTH) not in quantity.SHOWN:
        return Shown(compared, {}, {})
    name = asked.truth.removeprefix(TRUTH)
    truth = np.asarray(told.recording[asked.truth], float)
    scores = {method: {name: estimators.score_answers(one, name, truth)} for method, one in compared.answers.items()}
    guess = np.asarray(quantity.do_nothing(car, own)[name], float)
    there = np.isfinite(truth) & np.isfinite(guess)
    nothing = {name: float(np.sqrt(np.mean((guess - truth)[there] ** 2)))} if there.any() else {}
    return Shown(compared, scores, nothing)


def _compared(asked: Asked, quantity: ModuleType, car: CarSpecification, own: Recording, told: Told) -> Compared:
    """Run the methods that are asked for, each where the log's check found no error in a channel that it reads; reasons of
    refusals name the option that helps."""
    methods = asked.methods or (quantity.RECOMMENDED,)
    go_on = len(asked.what) > 1 if asked.methods is None else set(methods) == set(quantity.METHODS)
    found = Compared({}, {}, {})
    for name in methods:
        try:
            if not asked.anyway:
                check_trusted(told.log, told.findings, read_by(quantity, name, car, told.seen))
            one = estimators.compare(car, own, quantity, [name], smoothed=not asked.live)
        except InputError as error:
            reason = with_fill_option(str(error))
            if not go_on:
                raise InputError(reason) from error
            found.refused[name] = reason
            continue
        found.answers.update(one.answers)
        found.microseconds.update(one.microseconds)
        found = found._replace(smoothed=found.smoothed + one.smoothed)
    return found


def _conclude(asked: Asked, told: Told, product: Path, found: dict[str, Shown]) -> dict[str, Any]:
    """Print, write and draw the results for one log; return its numbers for the JSON file."""
    log, recording = told.log, told.recording
    _print(log, found)
    answers = {
        (quantity, method): one for quantity, shown in found.items() for method, one in shown.compared.answers.items()
    }
    if not answers:
        raise InputError(f"{log.name}: no quantity can be estimated; the reasons are printed above.")
    io.write_frame(_frame(answers), product, overwrite=asked.force)
    results().print(
        f"{product}: {len(recording)} rows of {', '.join(_label(*key, answers) or '.'.join(key) for key in answers)}",
        markup=False,
    )
    figures = [] if asked.out is None else _draw(asked, log, recording, found)
    return {
        "file": product, "rows": len(recording), "figures": figures,
        **{quantity: _numbers(shown) for quantity, shown in found.items()},
    }  # fmt: skip


def _print(log: Path, found: dict[str, Shown]) -> None:
    for quantity, shown in found.items():
        module, rows = QUANTITIES[quantity], []
        for method, answers in shown.compared.answers.items():
            for name, unit in module.SHOWN.items():
                mean, std, known = (
                    np.asarray(getattr(part, name)) for part in (answers.mean, answers.std, answers.known)
                )
                score = shown.scores.get(method, {}).get(name)
                looks = "all" if method in shown.compared.smoothed else "up to it"
                rows.append((
                    method, looks, f"{name} [{unit}]", spread(mean[-1], std[-1]), f"{100.0 * known.mean():.0f} %",
                    number(shown.compared.microseconds[method], 3), *_cells(score),
                ))  # fmt: skip
        rows += [
            (NOTHING, "-", f"{n} [{module.SHOWN[n]}]", "-", "-", "-", number(e), "-", "-", "-", "-")
            for n, e in shown.nothing.items()
        ]
        columns = (
            "method", "uses rows", "what", "at the end", "known", "us a step", "rmse", "of it known", "worst", "delay [s]",
            "in 95 %",
        )  # fmt: skip
        width = len(columns) if shown.scores else 6
        if rows:
            table(f"{quantity} along {log.name}", columns[:width], [row[:width] for row in rows], left=3)
        for method, reason in shown.compared.refused.items():
            results().print(f"{quantity}, {method}: not taken. {reason}", markup=False, soft_wrap=True)


def _cells(score: MethodScore | None) -> tuple[str, ...]:
    if score is None:
        return ("-",) * 5
    inside = score.score.coverage_95
    cells = (score.score.rmse, score.rmse_known, score.score.worst, score.delay)
    return (*map(number, cells), "-" if np.isnan(inside) else f"{100.0 * inside:.0f} %")


def _label(quantity: str, method: str, answers: dict[tuple[str, str], Answers]) -> str:
    """Return the prefix of a column's name: none for a single answer, else the quantity, with its method if it has several."""
    if len(answers) == 1:
        return ""
    several = sum(key[0] == quantity for key in answers) > 1
    return f"{quantity}.{method}" if several else quantity


def _frame(answers: dict[tuple[str, str], Answers]) -> Any:
    """Return columns with the outputs of each method, their standard deviations, and whether each is known (0 or 1)."""
    columns, units = {}, {}
    for key, one in answers.items():
        before = _label(*key, answers)
        for name, unit in QUANTITIES[key[0]].SHOWN.items():
            column = f"{before}.{name}" if before else name
            columns[column] = np.asarray(getattr(one.mean, name))
            columns[f"{column}_std"] = np.asarray(getattr(one.std, name))
            columns[f"{column}_known"] = np.asarray(getattr(one.known, name), float)
            units |= {column: unit, f"{column}_std": unit}
    time = np.asarray(next(iter(answers.values())).time)
    return io.to_frame(Recording(time, columns, units))


def _numbers(shown: Shown) -> dict[str, Any]:
    scores = {
        method: {
            name: {**one.score._asdict(), "known": one.known, "rmse_known": one.rmse_known, "delay_s": one.delay}
            for name, one in by_name.items()
        }
        for method, by_name in shown.scores.items()
    }
    ends = {
        method: {name: float(np.asarray(one[name])[-1]) for name in one.mean._fields}
        for method, one in shown.compared.answers.items()
    }
    return {
        "at_the_end": ends, "scores": scores, "nothing_done_rmse": shown.nothing, "refused": shown.compared.refused,
        "microseconds_a_step": shown.compared.microseconds, "smoothed": shown.compared.smoothed,
    }  # fmt: skip


def _draw(asked: Asked, log: Path, recording: Recording, found: dict[str, Shown]) -> list[Path]:
    """Draw one figure per quantity, with all its methods and the truth."""
    from jaxveh import plots

    assert asked.out is not None  # the caller draws only if there is a folder
    out = asked.out if len(asked.logs) == 1 else asked.out / log.stem
    make_folder(out)
    paths = []
    for quantity, shown in found.items():
        if not shown.compared.answers:
            continue
        names = tuple(QUANTITIES[quantity].SHOWN)
        name = None if asked.truth is None else asked.truth.removeprefix(TRUTH)
        truth = {name: np.asarray(recording[asked.truth])} if name in names else None  # type: ignore[index]
        figure = plots.estimate(shown.compared.answers, truth, names, errors=truth is not None)
        paths.append(plots.save(figure, out / f"{quantity}.png"))
        results().print(f"figure: {paths[-1]}", markup=False)
    return paths
