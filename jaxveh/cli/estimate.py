"""`jaxveh estimate`: states of a car along a log, with standard deviations, and a score where there is a truth."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from jaxveh import InputError, io
from jaxveh._core.errors import check_at_least, check_one_of
from jaxveh.cli import options, sideslip
from jaxveh.cli.blanking import fill_gaps, split
from jaxveh.cli.console import number, progress, results, spread, table
from jaxveh.cli.output import check_product, check_report, make_folder, write_numbers


class Filter(StrEnum):
    """Which filter."""

    ekf = "ekf"
    ukf = "ukf"
    apf = "apf"
    pf = "pf"


PRODUCT = typer.Option(
    "-o", metavar="FILE", show_default=False, help="Time series with standard deviations: .parquet, .csv, .mf4 or .mdf."
)
TRUTH = typer.Option(
    "--truth",
    metavar="CHANNEL",
    help="Score against this channel (v_y or sideslip), which no estimator gets to see (but see --calibrate-on).",
)
FILTER = typer.Option(
    "--filter", help="Extended or unscented Kalman (smoothed), auxiliary or bootstrap particle filter."
)
AS_TOLD = typer.Option("--as-told", help="Take the car file at its word: nothing is fitted.")
PARTICLES = typer.Option("--particles", help="Of a particle filter, at least 2.")


def estimate(
    log: options.Log,
    vehicle: options.VehicleFile,
    product: Annotated[Path, PRODUCT],
    channels: options.Channels = None,
    calibrate: options.Calibrate = None,
    calibrate_on: options.CalibrateOn = None,
    as_told: Annotated[bool, AS_TOLD] = False,
    fill: options.Fill = None,
    truth: Annotated[str | None, TRUTH] = None,
    filter: Annotated[Filter, FILTER] = Filter.ekf,
    particles: Annotated[int, PARTICLES] = 1000,
    seed: options.Seed = 0,
    numbers: options.Numbers = None,
    out: options.Out = None,
    force: options.Force = False,
) -> None:
    """Estimate sideslip, slip and forces of a car from v_x, a_x, a_y and yaw_rate.

    With --calibrate the rear axle, noises and sensor offsets are fitted on that span first, and the rows after it are
    estimated. Without it the log calibrates itself: they are fitted on all its rows, of which no reference is seen, and
    all rows are estimated; --as-told takes the car file at its word instead. The file has a column for
    each state and, beside it, <name>_std, its standard deviation: m/s, rad, rad/s.

    The car file is TOML in SI units with mass, yaw_inertia, front_axle_to_cg, rear_axle_to_cg and, for each axle, its
    cornering stiffness or Magic Formula coefficients: see [bold]jaxveh schema car[/].

    Examples:

    [bold]jaxveh estimate drive.csv --vehicle car.toml -o estimate.parquet --calibrate 0:120[/]

    [bold]jaxveh estimate drive.csv --vehicle car.toml -o estimate.csv --calibrate 0:120 --calibrate-on v_y --truth v_y[/]
    """
    check_product(product, io.SUFFIXES, force, (log, vehicle, channels))
    check_report(out, numbers)
    check_at_least("--particles", particles, 2)
    if truth is not None:
        check_one_of("--truth", truth, sideslip.SCORED)
    car, recording = io.read_car(vehicle), fill_gaps(io.read_recording(log, channels), fill)
    span = options.span_of(calibrate, float(recording.time[0]), float(recording.time[-1]))
    uses = tuple(calibrate_on or ())
    parts = split(recording, span, uses, truth)
    part, reason = _calibrated_on(parts, span, as_told)
    with progress("estimate") as report:
        calibration = None if reason else sideslip.calibrate(car, part, uses, report)
        report(0, 1, "estimating (compiling first)")
        found = sideslip.estimate(calibration or car, parts.estimate, filter.value, particles, seed)
        report(1, 1, "scoring")
        score = None if truth is None else sideslip.score(car, found, parts.truth, truth)
    io.write_frame(io.to_frame(found), product, overwrite=force)
    _print(product, found, calibration, score, span, reason)
    figures = [] if out is None else _draw(found, recording, parts.truth, truth, car, span, out)
    configuration = {
        "log": log, "vehicle": vehicle, "channels": channels, "calibrate": calibrate, "calibrate_on": uses,
        "as_told": as_told, "fill": fill, "truth": truth, "filter": filter.value, "particles": particles,
    }  # fmt: skip
    shown = {
        "file": product, "rows": len(found.time), "start_s": found.time[0], "end_s": found.time[-1], "figures": figures
    }  # fmt: skip
    write_numbers(numbers, {**(score or {}), **sideslip.fitted_parameters(calibration), **shown}, configuration, seed)


def _calibrated_on(parts: Any, span: Any, as_told: bool) -> tuple[Any, str | None]:
    """The rows to calibrate on, and the reason why nothing is calibrated, None where it is."""
    if as_told and span is not None:
        raise InputError("--as-told fits nothing: leave --calibrate out, or --as-told.")
    part = parts.estimate if span is None else parts.calibration
    if as_told:
        return part, "--as-told"
    return part, None if span is not None else sideslip.why_not_calibrated(part)


def print_fitted(calibration: Any) -> None:
    """Print the fitted parameters as a table."""
    rows = [
        (name, spread(one["value"], one["std"]), one["unit"])
        for name, one in sideslip.fitted_parameters(calibration)["fitted"].items()
    ]
    table("Fitted on the calibration span", ("parameter", "value ± std", "unit"), rows)


def _print(product: Path, found: Any, calibration: Any, score: dict | None, span: Any, reason: str | None) -> None:
    if reason:
        results().print(f"Nothing was calibrated, the car file is taken at its word: {reason}.")
    elif span is None:
        results().print("The log calibrated itself, on all its rows and without a reference.")
    if calibration is not None:
        print_fitted(calibration)
    if score is not None:
        rows = [(name, f"{value}" if isinstance(value, int) else number(value)) for name, value in score.items()]
        table("Score over the rows estimated, by the names of the JSON file", ("what", "value"), rows)
    time = np.asarray(found.time)
    results().print(f"{product}: {time.size} rows from {time[0]:g} to {time[-1]:g} s")


def _draw(found: Any, recording: Any, seen: Any, truth: str | None, car: Any, span: Any, out: Path) -> list[Path]:
    from jaxveh import plots

    make_folder(out)
    names = ("sideslip", "v_y", "yaw_rate") if truth is None else ("sideslip", "v_y")
    true = None if truth is None else sideslip.truth_of(seen, truth)
    others = {} if truth is None or "steer" not in seen else {"open-loop linear model": sideslip.open_loop(car, seen)}
    spans = [] if span is None else [(max(span[0], float(recording.time[0])), span[1], "calibration")]
    paths = [
        plots.save(plots.recording(recording, spans=spans), out / "channels.png"),
        plots.save(plots.estimate(found, true, names, others=others, errors=true is not None), out / "estimate.png"),
    ]
    for path in paths:
        results().print(f"figure: {path}")
    return paths
