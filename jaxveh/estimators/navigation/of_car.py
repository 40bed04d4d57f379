"""A navigation of a car's file."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from jaxveh._core.errors import InputError
from jaxveh.estimators.navigation.method import Navigation, navigation_model
from jaxveh.estimators.navigation.system import PLAIN, Navigator, Parts
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

SATELLITE_DELAY, CAMERA_DELAY, UNIT_DELAY = 0.15, 0.08, 0.01
"""s: what is usual of a series car where its file does not say."""

USUAL_LOW_PASS = 15.0
"""Hz: so is the low-pass in its inertial unit."""

USUAL_HEIGHT = 0.55
"""m: of a centre of gravity whose height a file does not say; it shifts load by acceleration, a correction."""


def navigation(parts: Parts) -> Callable[[CarSpecification], Navigation]:
    """What makes a navigation with these `parts` of a car's file."""
    return lambda car: navigation_of(car, parts)


def navigation_of(car: CarSpecification, parts: Parts = PLAIN, **numbers: Any) -> Navigation:
    """The navigation of a car, with these `parts`; `numbers` of `Navigator` that are not in the file, by name.

    A file that says no `antenna_position` has its antenna at the centre of gravity; without delays they are those of a usual
    series car, `SATELLITE_DELAY` and so on. `sensor_position` is the inertial unit's.
    """
    low_pass = USUAL_LOW_PASS if car.low_pass is None else car.low_pass
    # A Butterworth low-pass of second order delays slow signals by this.
    sensor_lag = _or(car.inertial_delay, UNIT_DELAY) + math.sqrt(2.0) / (2.0 * math.pi * low_pass)
    antenna = car.antenna_position or (0.0, 0.0, 0.0)
    unit = car.sensor_position or (0.0, 0.0, 0.0)
    told = {
        "lag": max(_or(car.satellite_delay, SATELLITE_DELAY) - sensor_lag, 0.0),
        "camera_lag": max(_or(car.camera_delay, CAMERA_DELAY) - sensor_lag, 0.0),
        "sensor_lag": sensor_lag,
        **dict(zip(("antenna_x", "antenna_y", "antenna_z"), antenna, strict=True)),
        **dict(zip(("unit_x", "unit_y"), unit[:2], strict=True)),
        "rear_axle_to_cg": car.rear_axle_to_cg,
        "front_axle_to_cg": car.front_axle_to_cg,
        "mass": car.mass,
        "yaw_inertia": car.yaw_inertia,
        "cg_height": car.cg_height or USUAL_HEIGHT,
    }
    if parts.axle != "none":
        told |= _axle(car)
    return Navigation(navigation_model(Navigator(**{**told, **numbers}, parts=parts)))


def _axle(car: CarSpecification) -> dict[str, float]:
    """Stiffness and grip of the rear axle, over its load at rest."""
    weight = car.mass * GRAVITY * car.front_axle_to_cg / car.wheelbase
    stiffness = car.rear_cornering_stiffness
    if stiffness is None:
        raise InputError("navigation: the car's file has no rear_cornering_stiffness (N/rad); give it.")
    grip = 1.0
    if car.rear is not None:
        grip = car.rear.D / (weight if car.rear.nominal_load is None else car.rear.nominal_load)
    return {"stiffness": stiffness / weight, "grip": grip}


def _or(value: float | None, usual: float) -> float:
    return usual if value is None else value
