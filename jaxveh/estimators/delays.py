"""Delays of a car's measurements: those of its file, or of a usual series car."""

from __future__ import annotations

import math

from jaxveh.io import CarSpecification

SATELLITE_DELAY, CAMERA_DELAY, UNIT_DELAY = 0.15, 0.08, 0.01
"""s: usual delays of a series car, for a file without them."""

USUAL_LOW_PASS = 15.0
"""Hz: usual corner frequency of the low-pass filter in its inertial unit."""

SHORTEST_DELAY = 1e-3
"""s: the least delay where a time is divided by it."""


def unit_delay(car: CarSpecification) -> float:
    """The delay of the inertial unit, s: its own, and that of a second-order Butterworth low-pass filter for slow signals."""
    low_pass = USUAL_LOW_PASS if car.low_pass is None else car.low_pass
    return _or(car.inertial_delay, UNIT_DELAY) + math.sqrt(2.0) / (2.0 * math.pi * low_pass)


def satellite_delay(car: CarSpecification) -> float:
    """The delay of the satellites, s."""
    return _or(car.satellite_delay, SATELLITE_DELAY)


def satellite_lag(car: CarSpecification) -> float:
    """The delay of the satellites beyond that of the inertial unit, s."""
    return max(satellite_delay(car) - unit_delay(car), 0.0)


def camera_lag(car: CarSpecification) -> float:
    """The delay of a camera beyond that of the inertial unit, s."""
    return max(_or(car.camera_delay, CAMERA_DELAY) - unit_delay(car), 0.0)


def _or(value: float | None, usual: float) -> float:
    return usual if value is None else value
