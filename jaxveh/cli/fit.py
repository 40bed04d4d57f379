"""`jaxveh fit`: a car file with tyres and steering offset fitted to a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from jaxveh import InputError, io
from jaxveh.cli import options, sideslip
from jaxveh.cli.blanking import calibration_part, fill_gaps
from jaxveh.cli.console import progress, results
from jaxveh.cli.estimate import print_fitted
from jaxveh.cli.output import check_product, check_report, make_folder, write_numbers

PRODUCT = typer.Option("-o", metavar="FILE", show_default=False, help="The fitted car: .toml.")


def fit(
    log: options.Log,
    vehicle: options.VehicleFile,
    product: Annotated[Path, PRODUCT],
    channels: options.Channels = None,
    calibrate: options.Calibrate = None,
    calibrate_on: options.CalibrateOn = None,
    fill: options.Fill = None,
    numbers: options.Numbers = None,
    out: options.Out = None,
    force: options.Force = False,
) -> None:
    """Fit axles, noises and sensor offsets to a log, or to a span of it, and write the car with what was found.

    What is fitted sees v_x, a_x, a_y, yaw_rate and steer (for the front axle), and the channels of --calibrate-on. The car file
    is TOML in SI units: [bold]jaxveh schema car[/].

    Example: [bold]jaxveh fit drive.csv --vehicle car.toml -o car_fitted.toml --calibrate 0:120[/]
    """
    check_product(product, (".toml",), force, (log, vehicle, channels))
    check_report(out, numbers)
    car, recording = io.read_car(vehicle), fill_gaps(io.read_recording(log, channels), fill)
    span = options.span_of(calibrate, float(recording.time[0]), float(recording.time[-1]))
    uses = tuple(calibrate_on or ())
    if out is not None and "steer" not in recording:
        raise InputError(
            "--out: the force curves need steer, which the log has not. Name its column, or leave --out away."
        )
    part = calibration_part(recording, span, uses)
    with progress("fit") as report:
        calibration = sideslip.calibrate(car, part, uses, report)
    where = f"{part.time[0]:g} to {part.time[-1]:g} s of {log.name}"
    io.write_car(sideslip.fitted_car(calibration, car, part), product, note=f"Fitted to {where}.", overwrite=force)
    print_fitted(calibration)
    results().print(f"{product}: fitted to {where}")
    if out is not None:
        from jaxveh import plots

        make_folder(out)
        figure = plots.force_curves(*sideslip.curves(calibration, car, part))
        results().print(f"figure: {plots.save(figure, out / 'force_curves.png')}")
    configuration = {
        "log": log,
        "vehicle": vehicle,
        "channels": channels,
        "calibrate": calibrate,
        "calibrate_on": uses,
        "fill": fill,
    }
    write_numbers(numbers, {**sideslip.fitted_parameters(calibration), "file": product}, configuration, None)
