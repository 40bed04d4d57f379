"""`jaxveh simulate`: simulate the measurements of a drive, together with the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import jax
import typer

from jaxveh import InputError, Recording, io, roads, simulation, vehicles
from jaxveh._core.errors import check_one_of, check_positive
from jaxveh.cli import manoeuvre as driving
from jaxveh.cli import options
from jaxveh.cli.console import progress, results, table
from jaxveh.cli.drive_report import draw, numbers_of, print_numbers
from jaxveh.cli.output import check_product, check_report, write_numbers
from jaxveh.cli.vehicle import BUILT_IN, first_line, vehicle_of
from jaxveh.manoeuvres import MANOEUVRES, USUAL, manoeuvre_options
from jaxveh.sensors import DEVICES, named_devices

EVENTS = {"standstill": simulation.standstill, "wheel-lift": simulation.wheel_lift}

PRODUCT = typer.Option(
    "-o", metavar="FILE", help="The recording: .csv, .parquet, .nc, .mf4 or .mdf.", show_default=False
)
VEHICLE = typer.Option(
    "--vehicle", metavar="CAR", help=f"A car file (jaxveh schema car), or one of {', '.join(BUILT_IN)}."
)
FIDELITY = typer.Option("--fidelity", metavar="NAME", help=f"The vehicle model: {', '.join(vehicles.kit.FIDELITIES)}.")
MANOEUVRE = typer.Option("--manoeuvre", metavar="NAME", help="The manoeuvre (--list shows all).")
ROAD = typer.Option("--road", metavar="ROAD", help=f"A road file (.toml), or one of {', '.join(roads.ROADS)}.")
FITTED = typer.Option("--devices", metavar="NAME", help=f"The measuring devices: {', '.join(DEVICES)}.")
SOLVER = typer.Option("--solver", metavar="NAME", help=f"The ODE solver: {', '.join(simulation.kit.SOLVERS)}.")
UNTIL = typer.Option(
    "--until", metavar="EVENT", help=f"End early at this event: {' or '.join(EVENTS)}.", show_default=False
)
SET = typer.Option(
    "--set", metavar="NAME=VALUE", help="An option of the manoeuvre (--list); repeatable.", show_default=False
)
SPEED = typer.Option("--speed", help="Speed, m/s; by default the manoeuvre's usual speed.", show_default=False)
STEER = typer.Option(
    "--steer-deg",
    help="Steer amplitude at the road wheels, degrees, left positive; by default usual.",
    show_default=False,
)
DURATION = typer.Option("--duration", help="Duration, s; by default the manoeuvre's own.", show_default=False)
LIST = typer.Option("--list", help="Show vehicles, manoeuvres with their options, roads and devices, and stop.")


def simulate(
    product: Annotated[Path | None, PRODUCT] = None,
    vehicle: Annotated[str, VEHICLE] = "passenger_car",
    fidelity: Annotated[str, FIDELITY] = "single-track",
    manoeuvre: Annotated[str, MANOEUVRE] = "double-lane-change",
    speed: Annotated[float | None, SPEED] = None,
    steer_deg: Annotated[float | None, STEER] = None,
    duration: Annotated[float | None, DURATION] = None,
    settings: Annotated[list[str] | None, SET] = None,
    road: Annotated[str, ROAD] = "level",
    devices: Annotated[str, FITTED] = "esc",
    rate: Annotated[float, typer.Option("--rate", help="Rows per second, Hz; devices have their own rates.")] = 100.0,
    yaw_rate_std: Annotated[float, typer.Option("--yaw-rate-std", help="Noise of esc's yaw rate, rad/s.")] = 0.005,
    a_y_std: Annotated[float, typer.Option("--a-y-std", help="Noise of esc's lateral acceleration, m/s^2.")] = 0.1,
    solver: Annotated[str, SOLVER] = "auto",
    until: Annotated[str | None, UNTIL] = None,
    seed: options.Seed = 0,
    out: options.Out = None,
    numbers: options.Numbers = None,
    force: options.Force = False,
    listed: Annotated[bool, LIST] = False,
) -> None:
    """Simulate a drive and write it as a recording: measured channels, inputs, and the truth as `true.<channel>`.

    The numbers that the manoeuvre's standard defines are printed. --out draws the manoeuvre's own figure, a top view of the
    drive, the wheel loads and the channels. --list shows all vehicles, manoeuvres, roads and devices.

    A step of the steering, with its figures: [bold]jaxveh simulate --manoeuvre step-steer --steer-deg 3 -o step.csv --out figs[/]

    The lane change of ISO 3888-1 on four wheels: [bold]jaxveh simulate --manoeuvre iso-lane-change --fidelity two-track-3dof
    --set preview_time=0.7 --out figures[/]

    Braking on ice to standstill, measured by the devices of a series car: [bold]jaxveh simulate --manoeuvre mu-jump-braking
    --fidelity seven-dof --road ice --until standstill --devices production --duration 40 -o brake.mf4[/]
    """
    if listed:
        return _list()
    _check(product, vehicle, road, devices, force, out, numbers, solver, until, rate)
    car = vehicle_of(vehicle, fidelity)
    asked = driving.parse_manoeuvre(manoeuvre, speed, steer_deg, duration, settings or (), car)
    # Each device folds its number into a key, which must differ from the keys of the driver and the road.
    drive_key, road_key, sensor_key = jax.random.split(jax.random.key(seed), 3)
    driver = driving.make(asked, drive_key)
    ground = None if road == "level" else roads.named_road(road, road_key)
    fitted = named_devices(devices, car, {"yaw_rate": yaw_rate_std, "a_y": a_y_std})
    with progress("simulate") as report:
        report(0, 1, f"{manoeuvre} (compiling)")
        recording = simulation.simulate(
            car, driver, fitted, sensor_key, road=ground, dt=1 / rate, solver=solver, progress=report,
            until=until and EVENTS[until](),
        )  # fmt: skip
    found = numbers_of(recording, asked, car)
    _print(found, recording, until, driver.duration)
    _keep(recording, product, asked, car, out, force)
    configuration = {
        "vehicle": vehicle, "fidelity": fidelity, "manoeuvre": manoeuvre, "speed": asked.speed, "steer_deg": asked.steer_deg,
        "duration": driver.duration, "options": asked.options, "road": road, "devices": devices, "rate": rate,
        "yaw_rate_std": yaw_rate_std, "a_y_std": a_y_std, "solver": solver, "until": until,
    }  # fmt: skip
    write_numbers(numbers, {**_summary(recording, product), "numbers": found}, configuration, seed)


def _print(found: dict[str, Any], recording: Recording, until: str | None, duration: float) -> None:
    """Print the numbers, and whether the event that should end the drive has not come."""
    if until is not None and recording.time[-1] > duration - 0.05:
        results().print(f"note: --until {until}: it does not happen within {duration:g} s.", soft_wrap=True)
    print_numbers(found)


def _summary(recording: Recording, product: Path | None) -> dict[str, Any]:
    return {
        "rows": len(recording), "channels": list(recording.names), "source": recording.source, "file": product,
        "start": recording.time[0], "end": recording.time[-1],
    }  # fmt: skip


def _check(product, vehicle, road, devices, force, out, numbers, solver, until, rate) -> None:
    """Raise `InputError`, before any work, for options that are wrong and files that could not be written in the end."""
    if product is None and out is None and numbers is None:
        raise InputError(
            "simulate: nothing to write: give -o FILE, --out DIR or --json FILE (--list shows the choices)."
        )
    check_product(product, io.SUFFIXES, force, (Path(vehicle), Path(road)))
    check_report(out, numbers)
    check_one_of("--devices", devices, DEVICES)
    check_one_of("--solver", solver, simulation.kit.SOLVERS)
    if until is not None:
        check_one_of("--until", until, EVENTS)
    check_positive("--rate", rate, "Hz")


def _keep(recording: Recording, product: Path | None, asked: Any, car: Any, out: Path | None, force: bool) -> None:
    """Write the recording and draw the figures if they are wanted, and print their names."""
    if product is not None:
        io.write_recording(recording, product, overwrite=force)
        results().print(f"{product}: {len(recording)} rows, {', '.join(recording.names)}")
    for path in [] if out is None else draw(recording, asked, car, out):
        results().print(f"figure: {path}")


def _list() -> None:
    """Print the vehicles, fidelities, manoeuvres, roads and devices to choose from."""
    table(
        "Vehicles (--vehicle)",
        ("name", "description"),
        [(name, first_line(make)) for name, make in BUILT_IN.items()],
        left=2,
    )
    table(
        "Fidelities (--fidelity)",
        ("name", "description"),
        [(name, first_line(kind)) for name, kind in vehicles.kit.FIDELITIES.items()],
        left=2,
    )
    rows = []
    for name, one in MANOEUVRES.items():
        settings = [
            f"{key}={value:g}"
            for key, value in manoeuvre_options(name).items()
            if key != "duration" and value is not None
        ]
        speed, steer = USUAL[name]
        usual = f"{speed:.3g} m/s" + (f", {steer:g}°" if steer else "")
        rows.append((name, one.help, usual, " ".join(settings)))
    heads = ("name", "description", "usual", "options")
    table("Manoeuvres (--manoeuvre), their usual speed and steer, and the options of --set", heads, rows, left=4)
    table("Roads (--road)", ("name", "description"), [(name, one.help) for name, one in roads.ROADS.items()], left=2)
    table("Devices (--devices)", ("name", "description"), [(name, one.help) for name, one in DEVICES.items()], left=2)
