"""Navigation methods from a car's file."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from jaxveh.estimators.delays import camera_lag, satellite_lag, unit_delay
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.navigation.method import Navigation, navigation_model
from jaxveh.estimators.navigation.system import PLAIN, Navigator, Parts
from jaxveh.estimators.rear_steer import with_rear_steer
from jaxveh.io import AxleTyre, CarSpecification
from jaxveh.io import kit as io
from jaxveh.statespace import start_from
from jaxveh.vehicles import GRAVITY

USUAL_TRACK = 1.5
"""m: track of the rear wheels, for a file without it."""

USUAL_HEIGHT = 0.55
"""m: height of the centre of gravity, for a file without it; it only corrects the axle load for acceleration."""

SHAPES = 1.0, 8.0
"""Bounds of the curve's shape parameter."""


def navigation(parts: Parts) -> Callable[[CarSpecification], AbstractMethod]:
    """A function that makes a navigation with these `parts` from a car's file, whose rear wheels may be steered."""
    return lambda car: with_rear_steer(navigation_of(car, parts), car)


def navigation_of(car: CarSpecification, parts: Parts = PLAIN, **numbers: Any) -> Navigation:
    """The navigation of a car, with these `parts`; `numbers`: parameters of `Navigator` that are not in the file, by name.

    For a file without `antenna_position` the antenna is at the centre of gravity; missing delays are those of a usual series car
    (`delays`). `sensor_position` is that of the inertial unit.
    """
    io.check_car_file("navigation_of", car)
    parts = parts._replace(rear_steer=not car.steers_front_alone)
    antenna = car.antenna_position or (0.0, 0.0, 0.0)
    unit = car.sensor_position or (0.0, 0.0, 0.0)
    told = {
        "lag": satellite_lag(car),
        "camera_lag": camera_lag(car),
        "sensor_lag": unit_delay(car),
        **dict(zip(("antenna_x", "antenna_y", "antenna_z"), antenna, strict=True)),
        **dict(zip(("unit_x", "unit_y"), unit[:2], strict=True)),
        "rear_axle_to_cg": car.rear_axle_to_cg,
        "front_axle_to_cg": car.front_axle_to_cg,
        "mass": car.mass,
        "yaw_inertia": car.yaw_inertia,
        "track": car.track_rear or USUAL_TRACK,
        "cg_height": car.cg_height or USUAL_HEIGHT,
    }
    if car.pitch_gradient is not None:
        told["dip_gradient"] = car.pitch_gradient
    if parts.axle != "none":
        told |= _axle(car)
    model = navigation_model(Navigator(**{**told, **numbers}, parts=parts))
    return Navigation(model if car.roll_gradient is None else start_from(model, lean_gradient=car.roll_gradient))


def _axle(car: CarSpecification) -> dict[str, float]:
    """Stiffness and grip of the rear axle, over its static load."""
    weight = car.mass * GRAVITY * car.front_axle_to_cg / car.wheelbase
    # A file's axle always has a stiffness: its own, or that of its coefficients.
    stiffness = car.rear_cornering_stiffness or 0.0
    told = {"stiffness": stiffness / weight}
    if car.rear is not None:
        peak = car.rear.D / (weight if car.rear.nominal_load is None else car.rear.nominal_load)
        told |= {"grip": peak, "shape": _shape(car.rear)}
    return told


BEND = 0.8
"""Share of the peak at which the file's Magic Formula and the curve used here coincide."""


def _shape(tyre: AxleTyre) -> float:
    """The curve's shape parameter (-) that approximates a Magic Formula of these coefficients.

    The formula's slip angle at `BEND` of its peak, times the stiffness, over that force is `(1 - BEND^shape)^(-1 / shape)`.
    """
    formula = lambda x: math.sin(tyre.C * math.atan(x - tyre.E * (x - math.atan(x))))
    # The argument B a at which the formula reaches `BEND`; for formulas that never do, the upper end.
    x = _crossing(lambda x: formula(x) - BEND, 0.0, 50.0)
    stretch = max(tyre.C * x / BEND, 1.0 + 1e-3)
    return _crossing(lambda shape: stretch - (1.0 - BEND**shape) ** (-1.0 / shape), *SHAPES)


def _crossing(rising: Callable[[float], float], low: float, high: float) -> float:
    """The zero of a rising function by bisection; an end of the interval if there is none inside."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rising(middle) > 0 else (middle, high)
    return 0.5 * (low + high)
