"""Longitudinal speed from wheels, accelerometer and torques: section 2 of the review (Chen, Gao, Xu 2013)."""

from __future__ import annotations

from typing import Any

from jaxveh._core.recording import Recording
from jaxveh.estimators.method import Answers, LiveMethod, MethodOfCar, follow, method_of
from jaxveh.estimators.speed.car_numbers import speed_car
from jaxveh.estimators.speed.slip_aware import SlipAware
from jaxveh.estimators.speed.wheels import FastestWheel, SlowestWheel

NAME = "speed"

SHOWN = {"v_x": "m/s"}

METHODS = {
    "fastest_wheel": MethodOfCar(
        lambda car: FastestWheel(), "the fastest wheel: right unless all of them brake", "section 2"
    ),
    "slowest_wheel": MethodOfCar(
        lambda car: SlowestWheel(), "the slowest wheel: right unless all of them are driven", "section 2"
    ),
    "slip_aware": MethodOfCar(
        lambda car: SlipAware(speed_car(car)),
        "error-state filter that knows slip, radii and slopes, and distrusts wheels one by one",
        "sections 2.1 to 2.3",
    ),
}

RECOMMENDED = "fastest_wheel"


def estimate(source: Any, recording: Recording, *, method: str = RECOMMENDED) -> Answers:
    """Speed along a log. `source`: a car's file, or a method; `method`: a name of `METHODS`. **Raises** as `follow`."""
    return follow(NAME, method_of(NAME, METHODS, source, method), recording)


def live(source: Any, *, method: str = RECOMMENDED) -> LiveMethod:
    """The same a row at a time."""
    return LiveMethod(method_of(NAME, METHODS, source, method))
