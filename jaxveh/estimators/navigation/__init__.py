"""Satellite navigation with an inertial unit and a camera: sections 1.3.2 and 1.3.3 of the review (Chen, Gao, Xu 2013).

The answers have velocity, yaw and sideslip, and those of the filters roll, slopes and biases, too.
"""

from __future__ import annotations

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.navigation.method import Navigation, navigation_model
from jaxveh.estimators.navigation.multi_rate import multi_rate_of
from jaxveh.estimators.navigation.of_car import navigation, navigation_of
from jaxveh.estimators.navigation.system import Navigator, Parts
from jaxveh.estimators.quantity import check_drive, estimate_of, live_of
from jaxveh.io import CarSpecification

NAME = "navigation"

SHOWN = {"v_x": "m/s", "v_y": "m/s", "yaw": "rad", "sideslip": "rad"}

METHODS = {
    "kinematic": MethodOfCar(
        navigation(Parts()),
        "inertial unit of three axes and satellites, no vehicle model",
        "section 1.3.2 [44, 45]",
        any_steering=True,
    ),
    "six_axes": MethodOfCar(
        navigation(Parts(three_more=True)),
        "with roll and pitch from six axes",
        "sections 1.1.2, 1.3.2 [48-50]",
        any_steering=True,
    ),
    "two_antennas": MethodOfCar(
        navigation(Parts(heading=True)),
        "with the heading from two antennas",
        "section 1.3.2 [52, 53]",
        any_steering=True,
    ),
    "adapted_stiffness": MethodOfCar(
        navigation(Parts(wheels=True, axle="linear", adapts=True)),
        "with a linear rear axle whose stiffness is estimated from the satellites",
        "section 1.3.2 [46, 47]",
        any_steering=True,
    ),
    "rear_axle": MethodOfCar(
        navigation(Parts(wheels=True, axle="saturating", adapts=True)),
        "with a saturating rear axle whose stiffness is estimated",
        "section 1.3.2 [46, 47], with another tyre law",
        any_steering=True,
    ),
    "multi_rate": MethodOfCar(
        multi_rate_of, "a linear single track with yaw rate, and the course at its own rate", "section 1.3.2 [51]"
    ),
    "camera": MethodOfCar(
        navigation(Parts(wheels=True, camera=True, axle="saturating", adapts=True)),
        "with a rear axle and a slow, delayed camera of the lane",
        "section 1.3.3 [54, 55]",
        any_steering=True,
    ),
}

RECOMMENDED = "rear_axle"

__all__ = [
    "METHODS",
    "NAME",
    "RECOMMENDED",
    "SHOWN",
    "Navigation",
    "Navigator",
    "Parts",
    "do_nothing",
    "estimate",
    "live",
    "navigation_model",
    "navigation_of",
]


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """The satellites' last speed and course, as if the car had no sideslip; NaN before the first fix."""
    check_drive(f"{NAME}: do_nothing", car, recording)
    said = {"v_x": _held(recording, "speed"), "yaw": _held(recording, "course")}
    return said | dict.fromkeys(("v_y", "sideslip"), np.zeros(len(recording)))


def _held(recording: Recording, name: str) -> np.ndarray:
    if name not in recording:
        return np.full(len(recording), np.nan)
    values = np.asarray(recording[name], float)
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.size), 0))
    held = values[last]
    there = np.isfinite(held)
    if name == "course":
        held[there] = np.unwrap(held[there])
    return held


estimate = estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)
