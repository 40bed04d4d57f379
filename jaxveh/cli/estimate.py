"""`jaxveh estimate`: states of a car along its logs, with standard deviations, and a score if there is a truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from jaxveh import InputError, Recording, io
from jaxveh._core.errors import check_at_least, check_one_of
from jaxveh._core.recording import TRUTH as SIMULATED
from jaxveh.cli import options, quantities, quantity_options, sideslip
from jaxveh.cli.blanking import LogParts, read_for, split
from jaxveh.cli.calibration_words import say_source, source_in_words
from jaxveh.cli.console import number, progress, results, table
from jaxveh.cli.drives import Drive, read_drives
from jaxveh.cli.estimate_figures import draw
from jaxveh.cli.estimate_report import check_report_page, reported_log, write_report
from jaxveh.cli.output import check_product, check_products, check_report, write_numbers
from jaxveh.cli.several_logs import SeveralLogs
from jaxveh.cli.vehicle import car_of
from jaxveh.diagnostics import kit

MCAP_SUFFIX = io.kit.MCAP_SUFFIX


class Filter(StrEnum):
    """The filter."""

    ekf = "ekf"
    ukf = "ukf"
    apf = "apf"
    pf = "pf"


PRODUCT = typer.Option(
    "-o",
    metavar="FILE",
    show_default=False,
    help="Time series with standard deviations: .parquet, .csv, .nc, .mf4 or .mdf; or .mcap, with the log's channels and "
    "the truth as separate topics, for Foxglove and PlotJuggler. For several logs: a folder, with one .parquet per log.",
)
VEHICLE = typer.Option(
    "--vehicle",
    metavar="CAR",
    help=f"The car: {options.CAR_HELP}; not needed with --calibration, whose file contains the car.",
    show_default=False,
)
CALIBRATION = typer.Option(
    "--calibration",
    metavar="FILE",
    help="Estimate with this calibration file, written by `jaxveh fit`.",
    show_default=False,
)
TRUTH = typer.Option(
    "--truth",
    metavar="CHANNEL",
    help="Score the estimate against this channel (v_y or sideslip; true.v_y of a simulation). It is hidden from the estimator, "
    "except for --calibrate-on.",
)
REPORT = typer.Option(
    "--report",
    metavar="FILE.html",
    help="Write one page that opens without a network: check, fit, scores, and zoomable charts. --force replaces an old one.",
    show_default=False,
)
FILTER = typer.Option(
    "--filter", help="Extended or unscented Kalman (smoothed), auxiliary or bootstrap particle filter."
)
AS_TOLD = typer.Option("--as-told", help="Use the values of the car file; nothing is fitted.")
PARTICLES = typer.Option("--particles", help="Number of particles of a particle filter, at least 2.")


class Job(NamedTuple):
    """One log: its parts, the span for its calibration, the file of its estimate, and the folder of its figures."""

    drive: Drive
    parts: LogParts
    span: tuple[float, float] | None
    product: Path
    out: Path | None


def estimate(
    logs: options.Logs,
    product: Annotated[Path, PRODUCT],
    vehicle: Annotated[Path | None, VEHICLE] = None,
    calibration: Annotated[Path | None, CALIBRATION] = None,
    channels: options.Channels = None,
    span: options.Span = None,
    calibrate: options.Calibrate = None,
    calibrate_on: options.CalibrateOn = None,
    as_told: Annotated[bool, AS_TOLD] = False,
    fill: options.Fill = None,
    truth: Annotated[str | None, TRUTH] = None,
    filter: Annotated[Filter, FILTER] = Filter(quantity_options.USUAL_FILTER),
    particles: Annotated[int, PARTICLES] = quantity_options.USUAL_PARTICLES,
    seed: options.Seed = 0,
    numbers: options.Numbers = None,
    out: options.Out = None,
    report: Annotated[Path | None, REPORT] = None,
    force: options.Force = False,
    anyway: options.Anyway = False,
    what: quantity_options.What = sideslip.NAME,
    methods: quantity_options.Methods = None,
    live: quantity_options.Live = False,
    list_methods: quantity_options.Listed = False,
) -> None:
    """Estimate what a car cannot measure along its logs: sideslip, slip and forces, or another quantity (--what).

    By default a log calibrates itself: the rear axle, noises and sensor offsets are fitted on all its rows, without a reference,
    and then all rows are estimated; several logs of a car are calibrated together. With --calibrate the fit uses that span, and
    the rows after it are estimated; --calibration uses a file that jaxveh fit has written; --as-told uses the values of the car
    file. The output file has a column for each state and, beside it, <name>_std, its standard deviation: m/s, rad, rad/s.

    First of all the log is checked, as by jaxveh check: errors in channels that the quantity reads stop it (--anyway continues),
    others are notes. If one of several logs is refused, the others are estimated, and the program ends with an error.

    The car file is TOML in SI units with mass, yaw_inertia, front_axle_to_cg, rear_axle_to_cg and, for each axle, its
    cornering stiffness or Magic Formula coefficients: see [bold]jaxveh schema car[/].

    Examples:

    [bold]jaxveh estimate drive.csv --vehicle car.toml -o estimate.parquet[/]

    [bold]jaxveh estimate drive.csv --vehicle car.toml -o estimate.csv --calibrate 0:120 --calibrate-on v_y --truth v_y[/]

    [bold]jaxveh estimate monday.csv tuesday.csv --calibration calibration.toml -o estimates[/]

    [bold]jaxveh estimate drive.csv --vehicle car.toml -o speed.csv --what speed --methods all --truth v_x[/]
    """
    del list_methods
    choice = Choice(
        logs, product, vehicle, calibration, channels, span, calibrate, tuple(calibrate_on or ()), as_told, fill, truth,
        filter, particles, seed, out, report, force, anyway, live,
    )  # fmt: skip
    by_methods = quantities.quantities_asked(choice, what, methods)
    if by_methods is None:
        _estimate_sideslip(choice, numbers)
    else:
        quantities.estimate_quantities(by_methods, numbers)


def _estimate_sideslip(choice: Choice, numbers: Path | None) -> None:
    check_report(choice.out, numbers)
    several = SeveralLogs(choice.logs)
    fitted, estimates = _estimate(choice, several)
    several.check_some()
    shown = {"logs": estimates, "refused": several.reasons()}
    configuration = {
        name: value
        for name, value in choice._asdict().items()
        if name not in ("product", "seed", "out", "report", "force")
    }
    shown = shown if len(choice.logs) > 1 else next(iter(estimates.values()))
    write_numbers(numbers, {**sideslip.fitted_parameters(fitted), **shown}, configuration, choice.seed)
    several.conclude()


class Choice(NamedTuple):
    """The options of `estimate`."""

    logs: list[Path]
    product: Path
    vehicle: Path | None
    calibration: Path | None
    channels: Path | None
    span: str | None
    calibrate: str | None
    calibrate_on: tuple[str, ...]
    as_told: bool
    fill: float | None
    truth: str | None
    filter: Filter
    particles: int
    seed: int
    out: Path | None
    report: Path | None
    force: bool
    anyway: bool
    live: bool


def _estimate(choice: Choice, several: SeveralLogs) -> tuple[Any, dict[str, Any]]:
    """Return the calibration (None if the values of the car file are used), and the numbers of each log by its name."""
    products = _check(choice)
    told = None if choice.vehicle is None else car_of(choice.vehicle)
    found = None if choice.calibration is None else sideslip.read_calibration(choice.calibration, told)
    car = _car(told, found)
    # The open-loop baseline of a score is driven by the steer.
    used = {*read_for(car), *choice.calibrate_on, *((choice.truth, "steer") if choice.truth else ())}
    drives = read_drives(several, car, choice.channels, choice.fill, choice.span, used, choice.anyway)
    choice, drives = _with_simulated_truth(choice, drives, several)
    jobs = several.each(lambda drive: _job(choice, car, drive, products[drive.log]), drives)
    several.check_some()
    fitted_on, reason = ({}, None) if found else _fitted_on(choice, jobs)
    with progress("estimate") as report:
        if fitted_on:
            found = sideslip.calibrate(car, list(fitted_on.values()), choice.calibrate_on, report)
            found = found.with_log_names(*(log.name for log in fitted_on))
        report(0, 1, "estimating (compiling first)")
        how = (choice.filter.value, choice.particles, choice.seed, not choice.live)
        estimates = several.each(lambda job: sideslip.estimate(found or car, job.parts.estimate, *how), jobs)
        report(1, 1, "scoring")
    say_source(choice, found, reason, len(fitted_on))
    pairs = {log: (jobs[log], one) for log, one in estimates.items()}
    numbers = several.each(lambda pair: _conclude(choice, pair[0], pair[1], found, car), pairs)
    if choice.report is not None and numbers:
        source = source_in_words(choice, found, reason, len(fitted_on))
        _report(choice, several, [(*pairs[log], one) for log, one in numbers.items()], found, car, source)
    return found, {log.name: one for log, one in numbers.items()}


def _fitted_on(choice: Choice, jobs: Mapping[Path, Job]) -> tuple[dict[Path, Recording], str | None]:
    """Return the parts of the logs that a calibration is fitted to, or none and the reason; print which logs are left out."""
    if choice.as_told:
        return {}, "--as-told"
    if choice.calibrate is not None:
        return {log: job.parts.calibration for log, job in jobs.items() if job.parts.calibration is not None}, None
    why = {log: sideslip.why_not_calibrated(job.parts.estimate) for log, job in jobs.items()}
    usable = {log: jobs[log].parts.estimate for log, reason in why.items() if reason is None}
    if not usable:
        return {}, next(iter(why.values()))
    for log, reason in why.items():
        if reason is not None:
            results().print(f"note: the calibration leaves {log.name} out: {reason}.", markup=False, soft_wrap=True)
    return usable, None


def _check(choice: Choice) -> dict[Path, Path]:
    """Return the files of the estimates by log; raise `InputError` if options conflict, or a file could not be written."""
    logs, product = choice.logs, choice.product
    sources = (*logs, choice.vehicle, choice.channels, choice.calibration)
    if len(logs) == 1:
        products = [product]
        check_product(product, (*io.SUFFIXES, MCAP_SUFFIX), choice.force, sources)
        if product.suffix.lower() == MCAP_SUFFIX:
            io.kit.require("mcap", "writing MCAP", "mcap")
    else:
        products = [product / f"{log.stem}.parquet" for log in logs]
        check_products(product, products, choice.force, sources)
    check_report_page(choice.report, choice.force, sources)
    check_at_least("--particles", choice.particles, 2)
    if choice.truth is not None:
        check_one_of("--truth", choice.truth, (*sideslip.SCORED, *(f"{SIMULATED}{name}" for name in sideslip.SCORED)))
    if choice.as_told and choice.calibrate is not None:
        raise InputError("--as-told fits nothing: leave out --calibrate or --as-told.")
    if choice.calibration is not None and (choice.as_told or choice.calibrate is not None):
        other = "--as-told" if choice.as_told else "--calibrate"
        raise InputError(f"--calibration contains all fitted values: leave out {other} or --calibration.")
    if choice.calibrate is not None and len(logs) > 1:
        raise InputError("--calibrate takes one log: calibrate with `jaxveh fit`, and give its file as --calibration.")
    return dict(zip(logs, products, strict=True))


def _with_simulated_truth(
    choice: Choice, drives: dict[Path, Drive], several: SeveralLogs
) -> tuple[Choice, dict[Path, Drive]]:
    """In a simulated log put `true.v_y` in the place of a measured v_y, so that it is scored in the same way."""
    if choice.truth is None or not choice.truth.startswith(SIMULATED):
        return choice, drives
    name = choice.truth.removeprefix(SIMULATED)
    if name in choice.calibrate_on:
        raise InputError(
            f"--truth {choice.truth}: --calibrate-on uses {name}: take --truth {name}, or leave --calibrate-on out."
        )
    moved = lambda one: one._replace(recording=one.recording.replace(**{name: one.recording[choice.truth]}))
    return choice._replace(truth=name), several.each(moved, drives)


def _job(choice: Choice, car: io.CarSpecification, drive: Drive, product: Path) -> Job:
    time = drive.recording.time
    if product.suffix.lower() == MCAP_SUFFIX and time[0] < 0:
        raise InputError(
            f"-o {product}: time stamps must be at least zero, but the log begins at {time[0]:.15g} s: write another format."
        )
    span = options.span_of(choice.calibrate, float(time[0]), float(time[-1]))
    parts = split(drive.recording, span, choice.calibrate_on, choice.truth)
    sideslip.check_truth(car, parts.truth, choice.truth)
    out = choice.out if choice.out is None or len(choice.logs) == 1 else choice.out / drive.log.stem
    return Job(drive, parts, span, product, out)


def _car(told: io.CarSpecification | None, calibration: Any) -> io.CarSpecification:
    if calibration is not None:
        return calibration.told.car
    if told is None:
        raise InputError("--vehicle is missing: give the car's file (jaxveh schema car), or a --calibration.")
    return told


def _conclude(choice: Choice, job: Job, found: Any, calibration: Any, car: io.CarSpecification) -> dict[str, Any]:
    """Write one estimate, print its score and draw its figures; return its numbers for the JSON file."""
    score = None if choice.truth is None else sideslip.score(car, found, job.parts.truth, choice.truth)
    _write(choice, job, found, car)
    if score is not None:
        rows = [(name, f"{value}" if isinstance(value, int) else number(value)) for name, value in score.items()]
        title = f"Score over the estimated rows of {job.drive.log.name}, by the names of the JSON file"
        table(title, ("name", "value"), rows)
    time = np.asarray(found.time)
    results().print(f"{job.product}: {time.size} rows from {kit.shown_time(time[0], time[-1])} s", markup=False)
    figures = []
    if job.out is not None:
        figures = draw(found, job.drive.recording, job.parts.truth, choice.truth, car, calibration, job.span, job.out)
    shown = {"file": job.product, "rows": time.size, "start_s": time[0], "end_s": time[-1], "figures": figures}
    return {**(score or {}), **shown}


def _write(choice: Choice, job: Job, found: Any, car: io.CarSpecification) -> None:
    """Write the estimate; an MCAP file also gets the log and the truth as topics."""
    if job.product.suffix.lower() != MCAP_SUFFIX:
        io.write_frame(io.to_frame(found), job.product, overwrite=choice.force)
        return
    seen = job.parts.truth
    topics = {"/estimate": io.to_frame(found), "/log": io.to_frame(seen)}
    if choice.truth is not None:
        true = sideslip.truth_of(car, seen, choice.truth)
        units = {name: io.canonical_unit(name) or "" for name in true}
        topics["/truth"] = io.to_frame(Recording(seen.time, true, units, f"{choice.truth} of the log"))
    io.write_topics(topics, job.product, overwrite=choice.force)


def _report(
    choice: Choice, several: SeveralLogs, done: Sequence[tuple[Job, Any, dict]], calibration: Any,
    car: io.CarSpecification, source: str,
) -> None:  # fmt: skip
    """Write the page of all logs that are `done`."""
    assert choice.report is not None
    logs = [
        reported_log(
            job.drive, found, job.parts.truth, choice.truth, None if choice.truth is None else shown, car, calibration
        )
        for job, found, shown in done
    ]
    facts = {
        "car file": choice.vehicle, "truth": choice.truth, "filter": choice.filter.value, "span": choice.span,
        "no estimate of": " ".join(several.reasons().values()) or None,
    }  # fmt: skip
    drives = [job.drive for job, _, _ in done]
    write_report(choice.report, logs, drives, car, calibration, source, facts, overwrite=choice.force)
    results().print(f"report: {choice.report}", markup=False)
