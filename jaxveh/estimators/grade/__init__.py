"""The slope of the road along the car, positive uphill: section 3.1.2.3 of Chen, Gao & Xu 2013, and mass-grade-aukf.

An accelerometer measures `d v_x/dt - v_y r + g sin(grade)`. The part that the speed's rate does not explain is the grade and the
accelerometer's offset: 0.1 m/s^2 is 0.58 degrees. Torques at the wheels distinguish the two, and so does a vertical speed from
satellites.
"""

from __future__ import annotations

from jaxveh.estimators.grade.kinematic import Climb, kinematic_of, satellite_of
from jaxveh.estimators.joint import joint_filter
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.pulling import pulling_filter
from jaxveh.estimators.quantity import constant_of, live_of, smoothable_estimate_of
from jaxveh.estimators.rear_steer import with_rear_steer

NAME = "grade"

SHOWN = {"grade": "rad"}

METHODS = {
    "kinematic": MethodOfCar(
        kinematic_of, "the measured acceleration less the rate of the wheels' speed", "mass-grade-aukf [12]"
    ),
    "satellite": MethodOfCar(
        satellite_of, "the measured acceleration less the rate of the satellites' speed", "3.1.2.3 [128]"
    ),
    "climb": MethodOfCar(
        lambda car: Climb(),
        "the satellites' vertical speed over the horizontal one",
        "3.1.2.3 [128], as H. Bae et al. 2001",
    ),
    "joint": MethodOfCar(
        lambda car: joint_filter(car, ("grade",)),
        "the filter of mass, grade and offset of `mass_and_grade`",
        "mass-grade-aukf",
    ),
    "filter": MethodOfCar(
        lambda car: with_rear_steer(pulling_filter(car, NAME), car),
        "kinematics with the accelerometer's offset as a state, which is observable if wheel torques are available",
        "3.1.2.3 [124, 127]",
        any_steering=True,
    ),
}

RECOMMENDED = "filter"

do_nothing = constant_of(NAME, lambda car: {"grade": 0.0}, "Zero grade in all rows.")
estimate = smoothable_estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
