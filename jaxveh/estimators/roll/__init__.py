"""The body's roll, positive with the left side up: sections 1.1.1 and 1.1.2 of the review (Chen, Gao, Xu 2013).

`roll` is the body's roll against the **horizon**, which tilts gravity in an accelerometer; `body_roll` is the roll on its springs
against the road. `roll` is the sum of bank and `body_roll`. The two methods `steady` and `springs` only use the suspension: their
`roll` is the body's roll, which is that against the horizon on a level road. `roll_rate` is the rate of the angle; a gyroscope
measures it less a share of the yaw rate if the car points up or down.
"""

from __future__ import annotations

from jaxveh.estimators.leaning import leaning_filter
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.quantity import constant_of, live_of, smoothable_estimate_of
from jaxveh.estimators.rear_steer import with_rear_steer
from jaxveh.estimators.roll.gyro import gyro_of
from jaxveh.estimators.roll.six_axis import six_axis_of
from jaxveh.estimators.roll.suspension import springs_of, steady_of

NAME = "roll"

SHOWN = {"roll": "rad", "roll_rate": "rad/s"}

METHODS = {
    "gyro": MethodOfCar(
        gyro_of,
        "the integrated gyroscope, slowly drawn to the accelerometer's direction of gravity",
        "1.1.1 [10]",
    ),
    "steady": MethodOfCar(
        lambda car: steady_of(car, NAME),
        "the suspension's roll for the lateral acceleration, on a level road",
        "1.1.1 [10]",
        any_steering=True,
    ),
    "springs": MethodOfCar(
        lambda car: springs_of(car, NAME),
        "the same with the body's inertia and dampers, on a level road",
        "1.1.1 [10]",
        any_steering=True,
    ),
    "six_axis": MethodOfCar(
        six_axis_of, "attitude and velocity of a six-axis unit, corrected by the wheels' speed", "1.1.2 [9]"
    ),
    "filter": MethodOfCar(
        lambda car: with_rear_steer(leaning_filter(car, NAME), car),
        "one Kalman filter of bank, roll and the sensors' offsets; uses satellite course and roll gyroscope if available",
        "1.1.1, 1.1.2, 1.3.2 [46]",
        any_steering=True,
    ),
}

RECOMMENDED = "filter"

do_nothing = constant_of(NAME, lambda car: {"roll": 0.0, "roll_rate": 0.0}, "Zero roll and roll rate in all rows.")
estimate = smoothable_estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
