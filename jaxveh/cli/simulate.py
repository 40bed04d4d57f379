"""`jaxveh simulate`: a drive as sensors would have seen it, with the truth beside."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import jax
import typer

from jaxveh import io, manoeuvres, sensors, simulation
from jaxveh._core.errors import check_positive
from jaxveh.cli import options
from jaxveh.cli.console import progress, results
from jaxveh.cli.output import check_product, check_report, make_folder, write_numbers
from jaxveh.cli.vehicle import BUILT_IN, car_of


class Manoeuvre(StrEnum):
    """What the driver does."""

    double_lane_change = "double-lane-change"
    step_steer = "step-steer"
    swept_sine = "swept-sine"


VEHICLE_HELP = f"A car file (jaxveh schema car), or one of {', '.join(BUILT_IN)}."


def simulate(
    product: Annotated[
        Path,
        typer.Option("-o", metavar="FILE", help="The recording: .csv, .parquet, .mf4 or .mdf.", show_default=False),
    ],
    vehicle: Annotated[str, typer.Option("--vehicle", metavar="CAR", help=VEHICLE_HELP)] = "passenger_car",
    manoeuvre: Annotated[Manoeuvre, typer.Option("--manoeuvre")] = Manoeuvre.double_lane_change,
    speed: Annotated[float, typer.Option("--speed", help="m/s, held.")] = 25.0,
    steer_deg: Annotated[
        float, typer.Option("--steer-deg", help="Amplitude at the road wheels, degrees, left positive.")
    ] = 7.0,
    duration: Annotated[float, typer.Option("--duration", help="s")] = 7.0,
    rate: Annotated[float, typer.Option("--rate", help="Rows a second, Hz.")] = 100.0,
    yaw_rate_std: Annotated[float, typer.Option("--yaw-rate-std", help="Noise of the yaw rate, rad/s.")] = 0.005,
    a_y_std: Annotated[float, typer.Option("--a-y-std", help="Noise of the lateral acceleration, m/s^2.")] = 0.1,
    seed: options.Seed = 0,
    out: options.Out = None,
    numbers: options.Numbers = None,
    force: options.Force = False,
) -> None:
    """Simulate a manoeuvre and write it as a recording: measured channels, inputs, and the truth as `true.<channel>`.

    Example: [bold]jaxveh simulate --manoeuvre step-steer --steer-deg 3 -o drive.parquet --out figures[/]
    """
    check_product(product, io.SUFFIXES, force, (Path(vehicle),))
    check_report(out, numbers)
    check_positive("--rate", rate, "Hz")
    car = car_of(vehicle)
    drive = _manoeuvre(manoeuvre, speed, math.radians(steer_deg), duration)
    devices = sensors.esc(yaw_rate=yaw_rate_std, a_y=a_y_std)
    with progress("simulate") as report:
        report(0, 1, f"{manoeuvre.value} (compiling)")
        recording = simulation.simulate(car, drive, devices, key=jax.random.key(seed), dt=1 / rate)
    io.write_recording(recording, product, overwrite=force)
    results().print(f"{product}: {len(recording)} rows, {', '.join(recording.names)}")
    if out is not None:
        from jaxveh import plots

        make_folder(out)
        results().print(f"figure: {plots.save(plots.recording(recording), out / 'channels.png')}")
    configuration = {
        "vehicle": vehicle, "manoeuvre": manoeuvre.value, "speed": speed, "steer_deg": steer_deg, "duration": duration,
        "rate": rate, "yaw_rate_std": yaw_rate_std, "a_y_std": a_y_std,
    }  # fmt: skip
    shown = {"rows": len(recording), "channels": list(recording.names), "file": product}
    write_numbers(numbers, shown, configuration, seed)


def _manoeuvre(kind: Manoeuvre, speed: float, steer: float, duration: float):
    if kind is Manoeuvre.double_lane_change:
        return manoeuvres.double_lane_change(speed=speed, steer=steer, duration=duration)
    if kind is Manoeuvre.step_steer:
        return manoeuvres.step_steer(speed=speed, steer=steer, duration=duration)
    return manoeuvres.swept_sine(speed=speed, steer=steer, duration=duration)
