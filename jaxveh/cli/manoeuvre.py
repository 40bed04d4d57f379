"""The manoeuvre that the options name, with its own settings from `--set name=value`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax

from jaxveh import InputError, manoeuvres
from jaxveh._core.errors import check_one_of, did_you_mean
from jaxveh.manoeuvres import MANOEUVRES, USUAL, Course, manoeuvre_options, options_of_car

NOT_SET = {"speed": "--speed", "to_speed": "--speed", "steer": "--steer-deg", "duration": "--duration", "key": "--seed"}
"""Settings that have a command-line option of their own."""


class AskedManoeuvre(NamedTuple):
    """A manoeuvre as requested on the command line."""

    name: str
    speed: float
    steer_deg: float
    options: dict[str, Any]


def parse_manoeuvre(
    name: str, speed: float | None, steer_deg: float | None, duration: float | None, settings: Sequence[str], car: Any
) -> AskedManoeuvre:
    """Return the manoeuvre of a name with its `name=value` settings and its options from the car; None means the usual value.

    Raises `InputError` for an unknown manoeuvre or setting, a setting that is not a number, and a
    speed or steer out of range.
    """
    check_one_of("--manoeuvre", name, MANOEUVRES)
    # In the units of the options: the manoeuvre itself would tell of rad.
    if speed is not None:
        manoeuvres.kit.check_speed("--speed", speed)
    if steer_deg is not None:
        manoeuvres.kit.check_steer_deg("--steer-deg", steer_deg)
    usual_speed, usual_steer = USUAL[name]
    options = {**options_of_car(name, car), **_settings(name, settings)}
    if duration is not None:
        options["duration"] = duration
    return AskedManoeuvre(
        name, usual_speed if speed is None else speed, usual_steer if steer_deg is None else steer_deg, options
    )


def make(one: AskedManoeuvre, key: jax.Array) -> Any:
    """Make the manoeuvre or driver; random ones use `key`."""
    return manoeuvres.named_manoeuvre(one.name, one.speed, math.radians(one.steer_deg), key, **one.options)


def course_of(one: AskedManoeuvre) -> Course | None:
    """Return the cones of the manoeuvre's course; None if it has no course."""
    options = {**manoeuvre_options(one.name), **one.options}
    if one.name == "slalom-course":
        return manoeuvres.slalom_cones(options["spacing"], options["count"], options["start"])
    makers = {"iso-lane-change": manoeuvres.iso_3888_1, "iso-obstacle-avoidance": manoeuvres.iso_3888_2}
    if one.name not in makers:
        return None
    return makers[one.name](width_of(one), options["start"])


def width_of(one: AskedManoeuvre) -> float:
    """Return the width of the car for which the course is made, m; by default that of the ISO lane change."""
    return {**manoeuvre_options("iso-lane-change"), **manoeuvre_options(one.name), **one.options}["width"]


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
            guess = did_you_mean([option], known)
            raise InputError(f"--set {text}: {name} has no option {option!r}; there are: {there}.{guess}")
        found[option] = _number(text, value, isinstance(known[option], int))
    return found


def _number(text: str, value: str, whole: bool) -> float | int:
    try:
        return int(value) if whole else float(value)
    except ValueError:
        raise InputError(f"--set {text}: {value!r} is not a {'whole ' if whole else ''}number.") from None
