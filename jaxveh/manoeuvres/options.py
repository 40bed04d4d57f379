"""The options of named manoeuvres, besides speed and steer."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable
from typing import Any

from jaxveh._core.errors import InputError, check_one_of, did_you_mean
from jaxveh.manoeuvres.braking import braking_in_a_turn, mu_jump_braking
from jaxveh.manoeuvres.courses import iso_lane_change, iso_obstacle_avoidance, slalom_course, steady_circle
from jaxveh.manoeuvres.cruise import cruise
from jaxveh.manoeuvres.path_driver import PathDriver
from jaxveh.manoeuvres.random_steering import random_steering
from jaxveh.manoeuvres.standard_steering import ramp_steer, sine_with_dwell, slalom
from jaxveh.manoeuvres.steering import double_lane_change, step_steer, swept_sine

FUNCTIONS: dict[str, Callable[..., Any]] = {
    function.__name__.replace("_", "-"): function
    for function in (
        double_lane_change, step_steer, swept_sine, sine_with_dwell, ramp_steer, slalom, random_steering, braking_in_a_turn,
        mu_jump_braking, cruise, iso_lane_change, iso_obstacle_avoidance, slalom_course, steady_circle,
    )
}  # fmt: skip
"""The functions that make manoeuvres, by the manoeuvres' names."""

GIVEN = ("speed", "to_speed", "steer", "key")
"""The arguments that are set for every manoeuvre and are not options."""


def manoeuvre_options(name: str) -> dict[str, Any]:
    """The options of a manoeuvre by name, and their defaults (None if the value follows from the others).

    A closed-loop manoeuvre on a path also has those of `PathDriver`. Units are those in the docstring of the
    manoeuvre's function.

    **Raises** `InputError` for an unknown name, with a list of the known ones.
    """
    check_one_of("manoeuvre", name, FUNCTIONS)
    parameters = inspect.signature(FUNCTIONS[name]).parameters.values()
    found = {p.name: p.default for p in parameters if p.kind is not p.VAR_KEYWORD and p.name not in GIVEN}
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        found |= {
            field.name: field.default
            for field in dataclasses.fields(PathDriver)
            if field.default is not dataclasses.MISSING and field.name not in found
        }
    return found


def check_options(name: str, options: Iterable[str]) -> None:
    """Raise `InputError` for an option that the manoeuvre does not have, with a list of those that it has."""
    known = manoeuvre_options(name)
    unknown = [option for option in options if option not in known]
    if unknown:
        guess = did_you_mean(unknown, known)
        raise InputError(f"{name}: no option(s) {', '.join(unknown)}; there are: {', '.join(known)}.{guess}")
