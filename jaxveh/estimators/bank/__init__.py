"""The cross slope of the road, positive where the left side is higher: section 3.1.2.3 of the review (Chen, Gao, Xu 2013).

An accelerometer that leans with the body feels `f_y + g roll`, the yaw rate and the sideslip say `f_y - g bank`: their
difference is bank and roll together, and the suspension tells the roll. What stays is the accelerometer's offset: 0.1 m/s^2 is
0.58 degrees.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.bank.observers import disturbance_observer, unknown_input_observer
from jaxveh.estimators.bank.tseng import tseng_of
from jaxveh.estimators.leaning import leaning_filter
from jaxveh.estimators.method import Answers, LiveMethod, MethodOfCar, follow, method_of
from jaxveh.io import CarSpecification

NAME = "bank"

SHOWN = {"bank": "rad"}

METHODS = {
    "disturbance_observer": MethodOfCar(
        lambda car: disturbance_observer(car, NAME),
        "what pushes the car sideways beside its tyres, low-passed",
        "3.1.2.3 [125]",
    ),
    "unknown_input": MethodOfCar(
        lambda car: unknown_input_observer(car, NAME),
        "a proportional-integral observer of the lateral speed whose integral is the bank",
        "3.1.2.3 [126]",
    ),
    "tseng": MethodOfCar(
        lambda car: tseng_of(car, NAME),
        "the static bank, as far as steer, yaw rate and acceleration agree on it",
        "3.1.2.3 [123]",
    ),
    "filter": MethodOfCar(
        lambda car: leaning_filter(car, NAME),
        "bank, roll and the sensors' offsets in one Kalman filter; satellites' course and a roll gyroscope where there are any",
        "3.1.2.3, 1.3.2 [46]",
    ),
}

RECOMMENDED = "filter"


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """A road that does not bank."""
    del car
    return dict.fromkeys(SHOWN, np.zeros(len(recording)))


def estimate(source: Any, recording: Recording, *, method: str = RECOMMENDED) -> Answers:
    """Bank (rad) along a log. `source`: a car's file, or a method; `method`: a name of `METHODS`. **Raises** as `follow`."""
    return follow(NAME, method_of(NAME, METHODS, source, method), recording)


def live(source: Any, *, method: str = RECOMMENDED) -> LiveMethod:
    """The same a row at a time."""
    return LiveMethod(method_of(NAME, METHODS, source, method))
