"""What changes slowly in a car and is learned over drives: steering ratio and offset, centre of gravity, yaw inertia.

Section 3.1.2.4 of the review (Chen, Gao, Xu 2013), eq 17 with its erratum (`l r / v - delta`). The learner says nothing new where
nothing excites it: its values stay, their spreads too, and `known` is a flag of a spread that is small enough. Between drives
it is a file (`write_learned`, `read_learned`), which the next drive starts from (`start_from`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.geometry.learned import Learned, numbers_learned, read_learned, start_from, write_learned
from jaxveh.estimators.geometry.learner import UNITS, learner_of
from jaxveh.estimators.method import Answers, LiveMethod, MethodOfCar, follow, method_of
from jaxveh.io import CarSpecification

NAME = "geometry"

SHOWN = dict(UNITS)

METHODS = {
    "learner": MethodOfCar(
        lambda car: learner_of(car, NAME),
        "least squares of steer against yaw rate and of yaw moments, with flags of what a drive has told",
        "3.1.2.4, eq 17 [133]",
    ),
}

RECOMMENDED = "learner"


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """What the car's file says; an offset that it leaves out is none, a ratio is NaN."""
    told = {name: getattr(car, name) for name in SHOWN}
    told |= {"steer_offset": told["steer_offset"] or 0.0}
    return {name: np.full(len(recording), np.nan if value is None else value) for name, value in told.items()}


def estimate(source: Any, recording: Recording, *, method: str = RECOMMENDED) -> Answers:
    """The slow numbers along a log. `source`: a car's file, or a method; `method`: a name of `METHODS`. **Raises** as
    `follow`."""
    return follow(NAME, method_of(NAME, METHODS, source, method), recording)


def live(source: Any, *, method: str = RECOMMENDED) -> LiveMethod:
    """The same a row at a time."""
    return LiveMethod(method_of(NAME, METHODS, source, method))


__all__ = [
    "METHODS",
    "NAME",
    "RECOMMENDED",
    "SHOWN",
    "Learned",
    "do_nothing",
    "estimate",
    "live",
    "numbers_learned",
    "read_learned",
    "start_from",
    "write_learned",
]
