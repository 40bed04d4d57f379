"""The cross slope of the road, positive where the left side is higher: section 3.1.2.3 of the review (Chen, Gao, Xu 2013).

An accelerometer that leans with the body measures `f_y + g roll`, while yaw rate and sideslip give `f_y - g bank`. Their
difference contains bank and roll, and the suspension determines the roll. The accelerometer's offset remains: 0.1 m/s^2 is 0.58
degrees.
"""

from __future__ import annotations

from jaxveh.estimators.bank.observers import disturbance_observer, unknown_input_observer
from jaxveh.estimators.bank.tseng import tseng_of
from jaxveh.estimators.leaning import leaning_filter
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.quantity import constant_of, live_of, smoothable_estimate_of
from jaxveh.estimators.rear_steer import with_rear_steer

NAME = "bank"

SHOWN = {"bank": "rad"}

METHODS = {
    "disturbance_observer": MethodOfCar(
        lambda car: disturbance_observer(car, NAME),
        "the lateral acceleration that the tyres do not explain, low-passed",
        "3.1.2.3 [125]",
    ),
    "unknown_input": MethodOfCar(
        lambda car: unknown_input_observer(car, NAME),
        "a proportional-integral observer of the lateral speed whose integral is the bank",
        "3.1.2.3 [126]",
    ),
    "tseng": MethodOfCar(
        lambda car: tseng_of(car, NAME),
        "the static bank, weighted by the agreement of steer, yaw rate and acceleration",
        "3.1.2.3 [123]",
    ),
    "filter": MethodOfCar(
        lambda car: with_rear_steer(leaning_filter(car, NAME), car),
        "one Kalman filter of bank, roll and the sensors' offsets; uses satellite course and roll gyroscope if available",
        "3.1.2.3, 1.3.2 [46]",
        any_steering=True,
    ),
}

RECOMMENDED = "filter"

do_nothing = constant_of(NAME, lambda car: {"bank": 0.0}, "Zero bank in all rows.")
estimate = smoothable_estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
