"""The manoeuvre that options name, with its own settings from `--set name=value`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax

from jaxveh import InputError, manoeuvres, vehicles
from jaxveh._core.errors import check_one_of
from jaxveh.manoeuvres import MANOEUVRES, Course, manoeuvre_options

KMH = 1 / 3.6

USUAL: dict[str, tuple[float, float]] = {
    "double-lane-change": (25.0, 7.0),
    "step-steer": (25.0, 2.0),
    "swept-sine": (25.0, 1.0),
    "sine-with-dwell": (80 * KMH, 6.0),
    "ramp-steer": (25.0, 3.0),
    "slalom": (16.0, 3.0),
    "random-steering": (25.0, 0.7),
    "braking-in-a-turn": (25.0, 2.0),
    "mu-jump-braking": (25.0, 0.0),
    "cruise": (25.0, 0.0),
    "iso-lane-change": (80 * KMH, 0.0),
    "iso-obstacle-avoidance": (45 * KMH, 0.0),
    "slalom-course": (14.0, 0.0),
    "steady-circle": (16.0, 0.0),
}
"""Speed (m/s) and steer (degrees at the road wheels) of a manoeuvre unless told."""

NOT_SET = {"speed": "--speed", "to_speed": "--speed", "steer": "--steer-deg", "duration": "--duration", "key": "--seed"}
"""What has an option of its own."""


class AskedManoeuvre(NamedTuple):
    """A manoeuvre as the command line asks for it."""

    name: str
    speed: float
    steer_deg: float
    options: dict[str, Any]


def parse_manoeuvre(
    name: str, speed: float | None, steer_deg: float | None, duration: float | None, settings: Sequence[str], car: Any
) -> AskedManoeuvre:
    """The manoeuvre of a name with usual values for what is None, its `name=value` settings, and what it wants of the car.

    Raises `InputError` for an unknown manoeuvre or setting, and for a setting that is no number.
    """
    check_one_of("--manoeuvre", name, MANOEUVRES)
    usual_speed, usual_steer = USUAL[name]
    options = {**_of_car(name, car), **_settings(name, settings)}
    if duration is not None:
        options["duration"] = duration
    return AskedManoeuvre(
        name, usual_speed if speed is None else speed, usual_steer if steer_deg is None else steer_deg, options
    )


def make(one: AskedManoeuvre, key: jax.Array) -> Any:
    """The manoeuvre or driver; `key` for random ones."""
    return manoeuvres.named_manoeuvre(one.name, one.speed, math.radians(one.steer_deg), key, **one.options)


def course_of(one: AskedManoeuvre) -> Course | None:
    """The cones that the manoeuvre goes through, None where there are none."""
    options = {**manoeuvre_options(one.name), **one.options}
    if one.name == "slalom-course":
        return manoeuvres.slalom_cones(options["spacing"], options["count"], options["start"])
    makers = {"iso-lane-change": manoeuvres.iso_3888_1, "iso-obstacle-avoidance": manoeuvres.iso_3888_2}
    if one.name not in makers:
        return None
    return makers[one.name](width_of(one), options["start"])


def width_of(one: AskedManoeuvre) -> float:
    """The width of the car that the course is made for, m; where it has none of its own, that of the ISO lane change."""
    return {**manoeuvre_options("iso-lane-change"), **manoeuvre_options(one.name), **one.options}["width"]


def _of_car(name: str, car: Any) -> dict[str, float]:
    """What the manoeuvre would have to be told of the car: its mass and wheels where it brakes, its axles and how much it
    understeers where a driver follows a path."""
    known = manoeuvre_options(name)
    found = {part: getattr(car, part, None) for part in ("mass", "wheel_radius")}
    if hasattr(car, "front_axle_to_cg") and hasattr(car, "rear_axle_to_cg"):
        found["wheelbase"] = car.front_axle_to_cg + car.rear_axle_to_cg
    if "understeer_gradient" in known:
        found["understeer_gradient"] = understeer_of(car)
    return {part: float(value) for part, value in found.items() if part in known and value is not None}


def understeer_of(car: Any) -> Any:
    """Understeer gradient of the car on its tyres' slopes, rad s^2/m; None for a car without tyres."""
    if isinstance(car, vehicles.LinearSingleTrack):
        return car.understeer_gradient
    return vehicles.linear_single_track(car).understeer_gradient if hasattr(car, "front") else None


def _settings(name: str, settings: Sequence[str]) -> dict[str, float | int]:
    known, found = manoeuvre_options(name), {}
    for text in settings:
        option, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not option or not value:
            raise InputError(f"--set {text}: must be NAME=VALUE, such as --set {next(iter(known))}=2.")
        if option in NOT_SET:
            raise InputError(f"--set {text}: {option} has an option of its own, {NOT_SET[option]}.")
        if option not in known:
            there = ", ".join(option for option in known if option not in NOT_SET)
            raise InputError(f"--set {text}: {name} has no option {option!r}; there are: {there}.")
        found[option] = _number(text, value, isinstance(known[option], int))
    return found


def _number(text: str, value: str, whole: bool) -> float | int:
    try:
        return int(value) if whole else float(value)
    except ValueError:
        raise InputError(f"--set {text}: {value!r} is no {'whole ' if whole else ''}number.") from None
