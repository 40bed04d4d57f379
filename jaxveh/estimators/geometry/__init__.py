"""Parameters of a car that change slowly and are learned over drives: steering ratio and offset, centre of gravity, yaw inertia.

Section 3.1.2.4 of the review (Chen, Gao, Xu 2013), eq 17 with its erratum (`l r / v - delta`). Without excitation the learner's
values and standard deviations stay; `known` says that a standard deviation is small enough. Between drives the result is stored
in a file (`write_learned`, `read_learned`), from which the next drive starts (`start_from`).
"""

from __future__ import annotations

from jaxveh.estimators.geometry.learned import Learned, numbers_learned, read_learned, start_from, write_learned
from jaxveh.estimators.geometry.learner import UNITS, learner_of
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.quantity import constant_of, estimate_of, live_of
from jaxveh.estimators.rear_steer import with_rear_steer

NAME = "geometry"

SHOWN = dict(UNITS)

METHODS = {
    "learner": MethodOfCar(
        lambda car: with_rear_steer(learner_of(car, NAME), car),
        "least squares of steer against yaw rate and of yaw moments, with flags for the parameters that a drive determines",
        "3.1.2.4, eq 17 [133]",
        any_steering=True,
    ),
}

RECOMMENDED = "learner"


do_nothing = constant_of(
    NAME,
    lambda car: {name: getattr(car, name) for name in SHOWN} | {"steer_offset": car.steer_offset or 0.0},
    "The values of the car's file; a missing offset is zero, a missing ratio NaN.",
)
estimate = estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)


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
