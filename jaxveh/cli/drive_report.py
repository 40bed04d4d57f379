"""The results of `simulate` for a drive: numbers of standards, and figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jaxveh import InputError, Recording, diagnostics
from jaxveh.cli.console import number, results
from jaxveh.cli.failure import say
from jaxveh.cli.manoeuvre import AskedManoeuvre, course_of, width_of
from jaxveh.cli.output import make_folder
from jaxveh.diagnostics import drive_channels
from jaxveh.manoeuvres import clearance, understeer_of
from jaxveh.vehicles import GRAVITY, kit, linear_single_track

BODY = 4.5
"""Assumed length of the car between the cones, m; its width is the one for which the course was made."""

SPEED = 80 / 3.6
"""Speed at which FMVSS 126 defines the steer at 0.3 g, m/s."""


def wheelbase_of(car: Any) -> float | None:
    """Return the wheelbase, m; None for a car that has none."""
    car = kit.innermost_car(car)
    if not (hasattr(car, "front_axle_to_cg") and hasattr(car, "rear_axle_to_cg")):
        return None
    return float(car.front_axle_to_cg) + float(car.rear_axle_to_cg)


def steer_at_03g(car: Any) -> float | None:
    """Return the steer in a steady turn at 0.3 g and `SPEED` with linear tyres, rad; None for a car that has none.

    Rear wheels that are steered in a ratio to the front wheels are included; those with an input of their own are straight.
    """
    if wheelbase_of(car) is None or understeer_of(car) is None:
        return None
    linear = linear_single_track(car)
    if "steer" not in linear.steering.inputs:
        return None
    gain = float(linear.lateral_acceleration_gain(SPEED))
    return 0.3 * GRAVITY / gain if gain > 0 else None


def _reference_steer(asked: AskedManoeuvre, car: Any) -> float | None:
    """Return the steer at 0.3 g if the manoeuvre's steer is a multiple of it; otherwise None."""
    return steer_at_03g(car) if asked.name == "sine-with-dwell" else None


def numbers_of(recording: Recording, asked: AskedManoeuvre, car: Any) -> dict[str, dict[str, Any]]:
    """Return numbers by title and name, in SI units.

    If the drive does not allow the numbers of its standard, there are only the peaks, and a warning with the reason.
    """
    try:
        found = diagnostics.drive_numbers(
            recording, asked.name, wheelbase_of(car), steer_at_03g=_reference_steer(asked, car)
        )
    except InputError as error:
        say("warning", "yellow", f"no numbers of {asked.name}: {error}")
        found = diagnostics.drive_numbers(recording)
    shown = {title: one._asdict() for title, one in found.items()}
    course = course_of(asked)
    if course is not None and drive_channels.has(recording, "x", "y", "yaw"):
        x, y, yaw = (drive_channels.channel(recording, name) for name in ("x", "y", "yaw"))
        width = width_of(asked)
        body = f"body of {BODY:g} m x {width:g} m centred on the centre of gravity"
        shown[f"{course.name} ({body})"] = {"clearance": float(clearance(x, y, yaw, width, BODY, course))}
    return shown


def print_numbers(found: dict[str, dict[str, Any]]) -> None:
    """Print one line per title, without the unknown numbers."""
    results().print("In SI units (s, m, m/s, m/s^2, rad, N):")
    for title, values in found.items():
        words = [f"{name} {_word(value)}" for name, value in values.items() if not _is_missing(value)]
        if words:
            results().print(f"{title}: {', '.join(words)}", markup=False, soft_wrap=True)


def _word(value: Any) -> str:
    if value is None:
        return "not judged"
    return ("yes" if value else "no") if isinstance(value, bool | np.bool_) else number(value)


def _is_missing(value: Any) -> bool:
    return value is not None and not isinstance(value, bool | np.bool_) and np.isnan(value)


def draw(recording: Recording, asked: AskedManoeuvre, car: Any, out: Path) -> list[Path]:
    """Write the figures into a folder and return their paths."""
    from jaxveh import plots

    make_folder(out)
    figures: dict[str, Any] = {}
    course = course_of(asked)
    try:
        figures["drive"] = plots.drive(
            recording, asked.name, course=course, car=car, steer_at_03g=_reference_steer(asked, car)
        )
    except InputError as error:
        say("warning", "yellow", f"no figure of {asked.name}; an overview of the drive is drawn instead: {error}")
        figures["drive"] = plots.overview(recording)
    if drive_channels.has(recording, "x", "y", "yaw"):
        figures["top_view"] = plots.top_view(recording, course, car=car)
    if drive_channels.has(recording, "load_fl") or drive_channels.has(recording, "load_front"):
        figures["loads"] = plots.loads(recording)
    figures["channels"] = plots.recording(recording)
    return [plots.save(figure, out / f"{name}.png") for name, figure in figures.items()]
