"""`jaxveh fit`: calibrate a car from its logs, and keep the calibration for later estimates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from jaxveh import InputError, estimators, io
from jaxveh.cli import options, sideslip
from jaxveh.cli.blanking import calibration_part, read_for
from jaxveh.cli.calibration_words import print_fitted
from jaxveh.cli.console import progress, results
from jaxveh.cli.drives import Drive, read_drives
from jaxveh.cli.output import check_folders, check_product, check_report, make_folder, write_numbers
from jaxveh.cli.several_logs import SeveralLogs
from jaxveh.cli.vehicle import car_of
from jaxveh.diagnostics import kit

PRODUCT = typer.Option(
    "-o", metavar="FILE", show_default=False, help="The calibration file (.toml), for jaxveh estimate --calibration."
)
CAR_FILE = typer.Option(
    "--car-file",
    metavar="FILE",
    show_default=False,
    help="Also write the car file with the fitted values (.toml): tyres, inertia, steering offset.",
)


def fit(
    logs: options.Logs,
    vehicle: options.VehicleFile,
    product: Annotated[Path, PRODUCT],
    car_file: Annotated[Path | None, CAR_FILE] = None,
    channels: options.Channels = None,
    span: options.Span = None,
    calibrate_on: options.CalibrateOn = None,
    fill: options.Fill = None,
    numbers: options.Numbers = None,
    out: options.Out = None,
    force: options.Force = False,
    anyway: options.Anyway = False,
) -> None:
    """Fit the rear axle, noises and sensor offsets of a car to one log, or to several together, and write the calibration.

    The fit uses the channels v_x, a_x, a_y, yaw_rate and that of --calibrate-on; the front axle of --car-file also needs
    steer. The car file is TOML in SI units: [bold]jaxveh schema car[/].

    Examples:

    [bold]jaxveh fit drive.csv --vehicle car.toml -o calibration.toml --span 0:120[/]

    [bold]jaxveh fit monday.csv tuesday.csv --vehicle car.toml -o calibration.toml --car-file car_fitted.toml[/]
    """
    sources = (*logs, vehicle, channels)
    check_product(product, (".toml",), force, sources)
    check_product(car_file, (".toml",), force, sources, "--car-file")
    if car_file is not None and car_file.resolve() == product.resolve():
        raise InputError(f"--car-file {car_file}: is the file of the calibration, -o; name another file.")
    check_report(out, numbers)
    check_folders(out, logs)
    car, uses = car_of(vehicle), tuple(calibrate_on or ())
    used, several = {*read_for(car), *uses, *(("steer",) if car_file or out else ())}, SeveralLogs(logs)
    read = read_drives(several, car, channels, fill, span, used, anyway)
    parts = list(several.each(lambda drive: calibration_part(drive.recording, uses), read).values())
    several.check_all()
    drives = list(read.values())
    if out is not None and any("steer" not in drive.recording for drive in drives):
        raise InputError(
            "--out: the force curves need steer, which is missing from the log. Map its column, or leave --out out."
        )
    with progress("fit") as report:
        calibration = sideslip.calibrate(car, parts, uses, report).with_log_names(*(log.name for log in logs))
    estimators.write_calibration(calibration, product, overwrite=force)
    print_fitted(calibration)
    if (words := sideslip.reference_in_words(calibration, uses)) is not None:
        results().print(words)
    where = ", ".join(f"{kit.shown_time(one.start, one.end)} s of {one.log}" for one in calibration.spans)
    results().print(f"{product}: fitted to {where}", markup=False)
    figures = _write_car(calibration, car, drives, parts, where, car_file, out, force)
    configuration = {
        "logs": logs, "vehicle": vehicle, "channels": channels, "span": span, "calibrate_on": uses, "fill": fill,
        "anyway": anyway,
    }  # fmt: skip
    shown = {"file": product, "car_file": car_file, "figures": figures}
    write_numbers(numbers, {**sideslip.fitted_parameters(calibration), **shown}, configuration, None)


def _write_car(
    calibration: Any, car: io.CarSpecification, drives: list[Drive], parts: list, where: str, file: Path | None, out: Path | None,
    force: bool,
) -> list[Path]:  # fmt: skip
    """Write the fitted car as a file and draw its figures, if they are wanted; return the paths of the figures."""
    if file is None and out is None:
        return []
    fitted = sideslip.fitted_car(calibration, car, parts)
    if file is not None:
        io.write_car(fitted, file, note=f"Fitted to {where}.", overwrite=force)
        results().print(f"{file}: the fitted car", markup=False)
    if out is None:
        return []
    from jaxveh import plots

    figures = []
    for drive, part in zip(drives, parts, strict=True):
        folder = out if len(drives) == 1 else out / drive.log.stem
        make_folder(folder)
        figure = plots.force_curves(*sideslip.curves(calibration, car, fitted, part))
        figures.append(plots.save(figure, folder / "force_curves.png"))
        results().print(f"figure: {figures[-1]}", markup=False)
    return figures
