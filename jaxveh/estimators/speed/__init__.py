"""Longitudinal speed from wheels, accelerometer and torques: section 2 of the review (Chen, Gao, Xu 2013)."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.method import Answers, LiveMethod, MethodOfCar, follow, method_of
from jaxveh.estimators.speed.wheels import WHEEL_SPEEDS, FastestWheel, SlowestWheel
from jaxveh.io import CarSpecification

NAME = "speed"

SHOWN = {"v_x": "m/s"}

METHODS = {
    "fastest_wheel": MethodOfCar(
        lambda car: FastestWheel(), "the fastest wheel: right unless all of them brake", "section 2"
    ),
    "slowest_wheel": MethodOfCar(
        lambda car: SlowestWheel(), "the slowest wheel: right unless all of them are driven", "section 2"
    ),
}

RECOMMENDED = "fastest_wheel"


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """The mean of the wheels' speeds (m/s), held where none speaks."""
    del car
    wheels = [np.asarray(recording[need.channel], float) for need in WHEEL_SPEEDS if need.channel in recording]
    if not wheels:
        return {"v_x": np.full(len(recording), np.nan)}
    said = np.isfinite(wheels)
    mean = np.where(said, wheels, 0.0).sum(0) / np.maximum(said.sum(0), 1)
    last = np.maximum.accumulate(np.where(said.any(0), np.arange(len(mean)), 0))
    return {"v_x": mean[last]}


def estimate(source: Any, recording: Recording, *, method: str = RECOMMENDED) -> Answers:
    """Speed along a log. `source`: a car's file, or a method; `method`: a name of `METHODS`. **Raises** as `follow`."""
    return follow(NAME, method_of(NAME, METHODS, source, method), recording)


def live(source: Any, *, method: str = RECOMMENDED) -> LiveMethod:
    """The same a row at a time."""
    return LiveMethod(method_of(NAME, METHODS, source, method))
