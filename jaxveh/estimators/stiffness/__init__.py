"""Cornering stiffness of both axles, as the linear single track has it: section 3.1.2.2 of the review (Chen, Gao, Xu 2013).

It is the slope of an axle's lateral force over its slip angle at zero slip, including effects that are proportional to the force:
camber thrust, compliance, roll steer. The methods start from the values of the car's file.
"""

from __future__ import annotations

from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.quantity import constant_of, live_of, smoothable_estimate_of
from jaxveh.estimators.rear_steer import with_rear_steer
from jaxveh.estimators.stiffness.least_squares import AxleForces, Derivatives
from jaxveh.estimators.stiffness.single_track import linear_car, signals_of
from jaxveh.estimators.stiffness.walking import walking_stiffness
from jaxveh.estimators.stiffness.weighed import weighed_stiffness

NAME = "stiffness"

SHOWN = {"front_cornering_stiffness": "N/rad", "rear_cornering_stiffness": "N/rad"}

METHODS = {
    "weighed": MethodOfCar(
        lambda car: with_rear_steer(weighed_stiffness(car), car),
        "the filter `walking`, with the mass that a filter of grade and mass finds where a log has torques, and the car's file "
        "a wheel_radius; known only after half a minute of steering",
        "section 3.1.2.2, references [46, 47]",
        any_steering=True,
    ),
    "walking": MethodOfCar(
        lambda car: with_rear_steer(walking_stiffness(car), car),
        "Kalman filter of a linear single track with stiffnesses as slow states, offsets, lean and satellite course; known only "
        "after half a minute of steering",
        "section 3.1.2.2, references [46, 47]",
        any_steering=True,
    ),
    "axle_forces": MethodOfCar(
        lambda car: AxleForces(linear_car(car), signals_of(car)),
        "recursive least squares on axle forces and the difference of slip angles; known only where the yaw rate changes",
        "section 3.1.2.2, equation 15 (F_yr without cosine) and reference [120]",
    ),
    "derivatives": MethodOfCar(
        lambda car: Derivatives(linear_car(car), signals_of(car, lag=0.3)),
        "the derivative of a force over that of its slip angle at constant speed, biased low by noise; known only where "
        "steer and yaw rate change fast",
        "section 3.1.2.2, equation 16 as corrected, reference [122]",
    ),
}

RECOMMENDED = "weighed"

do_nothing = constant_of(
    NAME, lambda car: {name: getattr(car, name) for name in SHOWN}, "The stiffnesses of the car's file."
)
estimate = smoothable_estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
