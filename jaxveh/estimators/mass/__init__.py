"""The mass of a car: refs [8], [11], [12], [13] of mass-grade-aukf, and section 3.1.2.4 of Chen, Gao & Xu 2013.

The mass follows from force over acceleration. Its accuracy is that of the torque at the wheels and of the wheels' radius, and it
is only observable where pedals move. `known` says whether the standard deviation is within 5 per cent, of which 3 are for errors
of the torques and the wheel radius (not in `joint` and `forgetting`); without new information the mean stays.
"""

from __future__ import annotations

from jaxveh.estimators.joint import joint_filter
from jaxveh.estimators.mass.forgetting import forgetting_factors
from jaxveh.estimators.mass.ratios import Gated, HighPass, KinematicGrade, ratio_of
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.pulling import pulling_filter
from jaxveh.estimators.quantity import constant_of, live_of, smoothable_estimate_of
from jaxveh.estimators.rear_steer import with_rear_steer

NAME = "mass"

SHOWN = {"mass": "kg"}

METHODS = {
    "gated": MethodOfCar(
        lambda car: ratio_of(Gated, car, NAME),
        "least squares of force over acceleration, known only after some seconds above 0.6 m/s^2",
        "mass-grade-aukf [8]",
    ),
    "high_pass": MethodOfCar(
        lambda car: ratio_of(HighPass, car, NAME),
        "least squares of the fast parts of force and of the speed's rate, because grades are slow; known only where "
        "pedals have moved much",
        "mass-grade-aukf [11]",
    ),
    "forgetting": MethodOfCar(
        forgetting_factors,
        "recursive least squares of mass and grade, with faster forgetting of the grade",
        "mass-grade-aukf [13], 3.1.2.3 [127]",
    ),
    "kinematic_grade": MethodOfCar(
        lambda car: ratio_of(KinematicGrade, car, NAME),
        "the grade from accelerometer and speed, then least squares; known only after some seconds of acceleration",
        "mass-grade-aukf [12]",
    ),
    "joint": MethodOfCar(
        lambda car: joint_filter(car, ("mass",)),
        "the filter of mass, grade and offset of `mass_and_grade`",
        "mass-grade-aukf",
    ),
    "filter": MethodOfCar(
        lambda car: with_rear_steer(pulling_filter(car, NAME), car),
        "one filter of grade, mass and the accelerometer's offset, with bends, slip and a grade that changes with distance",
        "mass-grade-aukf [9, 10]",
        any_steering=True,
    ),
}

RECOMMENDED = "filter"

do_nothing = constant_of(NAME, lambda car: {"mass": car.mass}, "The mass of the car's file.")
estimate = smoothable_estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
