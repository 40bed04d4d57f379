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
from jaxveh.cli.drives import names_log, read_log
from jaxveh.cli.missing_speed import has_wheels, wants_v_x, with_speed
from jaxveh.cli.output import check_product, check_products, check_report, make_folder, write_numbers
from jaxveh.cli.quantity_options import QUANTITIES, USUAL_FILTER, USUAL_PARTICLES, inputs_of
from jaxveh.cli.vehicle import car_of
from jaxveh.estimators import Answers, Compared, MethodScore
from jaxveh.io import CarSpecification

ALL = "all"
"""In `--what`: each quantity that the log has channels for, by its recommended method; in `--methods`: all methods."""

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


class Shown(NamedTuple):
    """The result for one quantity and one log: the compared methods, and their scores by method and name.

    `nothing` is the RMSE of the do-nothing baseline, by name.
    """

    compared: Compared
    scores: dict[str, dict[str, MethodScore]]
    nothing: dict[str, float]


def names_of(text: str, option: str, known: Sequence[str]) -> tuple[str, ...]:
    """Split an option's value at commas into names without repetition; `all` stands for all known names.

    **Raises** `InputError` for an unknown name.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        check_one_of(option, name, (*known, ALL))
    return tuple(known) if ALL in names else names


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


def methods_of(text: str | None, what: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return the methods of `--methods`; None for the recommended ones.

    **Raises** `InputError` for several quantities, or for a name that is no method of the quantity.
    """
    if text is None:
        return None
    quantity, *others = what
    if others:
        raise InputError(f"--methods applies to one quantity: name one with --what, not {', '.join(what)}.")
    return names_of(text, f"--methods of {quantity}", tuple(QUANTITIES[quantity].METHODS))


def estimate_quantities(asked: Asked, numbers: Path | None) -> None:
    """Estimate the requested quantities along each log, then print, draw and write the results."""
    check_report(asked.out, numbers)
    products, car = _check(asked)
    found: dict[str, Any] = {}
    with progress("estimate") as report:
        told = [_log(asked, log, car) for log in asked.logs]
        shown = []
        for k, (log, (seen, recording)) in enumerate(zip(asked.logs, told, strict=True)):
            report(k, len(told), f"estimating along {log.name} (compiling first)")
            with names_log(log, asked.logs):
                own = _logs(asked, log, seen, car)
                shown.append({name: _one(asked, QUANTITIES[name], car, own[name], recording) for name in asked.what})
    for log, product, (_, recording), one in zip(asked.logs, products, told, shown, strict=True):
        found[log.name] = _conclude(asked, log, product, recording, one)
    content = found[asked.logs[0].name] if len(asked.logs) == 1 else {"logs": found}
    configuration = {name: value for name, value in asked._asdict().items() if name not in ("product", "out", "force")}
    write_numbers(numbers, content, configuration, None)


def _check(asked: Asked) -> tuple[list[Path], CarSpecification]:
    """Return the files to write, and the car; raise `InputError` if a file could not be written, or options conflict."""
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
        return [asked.product], car_of(asked.vehicle)
    products = [asked.product / f"{log.stem}.parquet" for log in asked.logs]
    check_products(asked.product, products, asked.force, sources)
    return products, car_of(asked.vehicle)


def _log(asked: Asked, log: Path, car: CarSpecification) -> tuple[Recording, Recording]:
    """Return the part of a log that the methods may use, and the whole log."""
    drive = read_log(log, car, asked.channels, asked.span, (asked.truth,), asked.anyway)
    recording = drive.recording
    if asked.truth is None:
        return _filled(asked, recording, car), recording
    if asked.truth not in recording:
        raise InputError(
            f"--truth {asked.truth}: {log.name} has no such channel; it has: {', '.join(recording.names)}."
        )
    hidden = {asked.truth, *ALIKE.get(asked.truth.removeprefix(TRUTH), (asked.truth.removeprefix(TRUTH),))}
    return _filled(asked, recording.without(*[name for name in recording.names if name in hidden]), car), recording


def _filled(asked: Asked, recording: Recording, car: CarSpecification) -> Recording:
    """Fill gaps in the inputs if `--fill` is given."""
    for name in inputs_of(asked.what, asked.methods, car) if asked.fill else ():
        if name in recording:
            recording = fill_short(recording, name, asked.fill)
    return recording


def _logs(asked: Asked, log: Path, seen: Recording, car: CarSpecification) -> dict[str, Recording]:
    """Return the log that each quantity sees: with `v_x` from the wheels, except for the speed itself; from the speed over
    ground only for methods that do not use that, too, as a measurement of its own."""
    wants = lambda quantity: wants_v_x(quantity, asked.methods or (quantity.RECOMMENDED,), car)
    wanting = {name for name in asked.what if name != SPEED and (has_wheels(seen) or wants(QUANTITIES[name]))}
    driven = _filled(asked, with_speed(log, seen, car), car) if wanting else seen
    return {name: driven if name in wanting else seen for name in asked.what}


def _one(asked: Asked, quantity: ModuleType, car: CarSpecification, seen: Recording, recording: Recording) -> Shown:
    """Estimate one quantity along one log.

    With several quantities, one that the log does not allow is listed as refused; a single quantity raises.
    """
    if asked.methods is None and len(asked.what) > 1:
        compared = _recommended(quantity, car, seen, not asked.live)
    else:
        every = asked.methods is not None and set(asked.methods) == set(quantity.METHODS)
        methods = None if every else asked.methods or [quantity.RECOMMENDED]
        compared = _compared(quantity, car, seen, methods, not asked.live)
    if asked.truth is None or asked.truth.removeprefix(TRUTH) not in quantity.SHOWN:
        return Shown(compared, {}, {})
    name = asked.truth.removeprefix(TRUTH)
    truth = np.asarray(recording[asked.truth], float)
    scores = {method: {name: estimators.score_answers(one, name, truth)} for method, one in compared.answers.items()}
    guess = np.asarray(quantity.do_nothing(car, seen)[name], float)
    there = np.isfinite(truth) & np.isfinite(guess)
    nothing = {name: float(np.sqrt(np.mean((guess - truth)[there] ** 2)))} if there.any() else {}
    return Shown(compared, scores, nothing)


def _recommended(quantity: ModuleType, car: CarSpecification, seen: Recording, smoothed: bool) -> Compared:
    """Run the recommended method, or record the reason why it cannot run."""
    try:
        return _compared(quantity, car, seen, [quantity.RECOMMENDED], smoothed)
    except InputError as error:
        return Compared({}, {quantity.RECOMMENDED: str(error)}, {})


def _compared(quantity: ModuleType, car: CarSpecification, seen: Recording, methods: Any, smoothed: bool) -> Compared:
    """Run the methods (None: all); reasons of refusals name the option that helps."""
    try:
        found = estimators.compare(car, seen, quantity, methods, smoothed=smoothed)
    except InputError as error:
        raise InputError(with_fill_option(str(error))) from error
    return found._replace(refused={name: with_fill_option(reason) for name, reason in found.refused.items()})


def _conclude(asked: Asked, log: Path, product: Path, recording: Recording, found: dict[str, Shown]) -> dict[str, Any]:
    """Print, write and draw the results for one log; return its numbers for the JSON file."""
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
            "method",
            "uses rows",
            "what",
            "at the end",
            "known",
            "us a step",
            "rmse",
            "of it known",
            "worst",
            "delay [s]",
            "in 95 %",
        )
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
