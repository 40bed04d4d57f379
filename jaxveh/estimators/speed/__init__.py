"""Longitudinal speed from wheels, accelerometer and torques: section 2 of the review (Chen, Gao, Xu 2013)."""

from __future__ import annotations

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.car_file import keys_of
from jaxveh.estimators.delays import SHORTEST_DELAY, satellite_delay, unit_delay
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.quantity import check_drive, estimate_of, live_of
from jaxveh.estimators.rear_steer import with_rear_steer
from jaxveh.estimators.speed.abs_peaks import AdaptiveNonlinear
from jaxveh.estimators.speed.accelerometer import AccelerometerIntegral
from jaxveh.estimators.speed.car_numbers import FORCE_KEYS, speed_car
from jaxveh.estimators.speed.forces import BrakeForces, MotorForces
from jaxveh.estimators.speed.fuzzy import Fuzzy
from jaxveh.estimators.speed.slip_aware import SlipAware
from jaxveh.estimators.speed.slip_state import Spreads
from jaxveh.estimators.speed.weighted import Weighted
from jaxveh.estimators.speed.wheels import WHEEL_SPEEDS, Combined, FastestWheel, SlopeLimited, SlowestWheel
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

NAME = "speed"

SHOWN = {"v_x": "m/s"}


def _brake_forces(car: CarSpecification) -> BrakeForces:
    return BrakeForces(**keys_of(car, "speed, brake_force", FORCE_KEYS | {"brake_torque_per_pressure": "N m/Pa"}))


def _slip_aware(car: CarSpecification) -> SlipAware:
    """Makes the filter with the accelerometer's gain from the file's pitch gradient, which is known to 0.3 % of the measured
    acceleration, or else with the gain of usual cars."""
    delays = {"a_x_delay": unit_delay(car), "satellite_delay": max(satellite_delay(car), SHORTEST_DELAY)}
    if car.pitch_gradient is None:
        return SlipAware(speed_car(car), **delays)
    return SlipAware(speed_car(car), Spreads(gain=0.003), GRAVITY * car.pitch_gradient, **delays)


METHODS = {
    "fastest_wheel": MethodOfCar(
        lambda car: FastestWheel(), "the fastest wheel: right unless all of them brake", "section 2.1, ref 86"
    ),
    "slowest_wheel": MethodOfCar(
        lambda car: SlowestWheel(), "the slowest wheel: right unless all of them are driven", "section 2.1, ref 86"
    ),
    "slope_limited": MethodOfCar(
        lambda car: SlopeLimited(), "the fastest wheel, limited to the rates that a car can have", "section 2.1, ref 86"
    ),
    "combined": MethodOfCar(
        lambda car: Combined(),
        "the fastest wheel in braking, the slowest in driving, with limited rates",
        "section 2.1, ref 86",
    ),
    "adaptive_nonlinear": MethodOfCar(
        lambda car: AdaptiveNonlinear(),
        "the wheels' peaks under ABS, and the deceleration between them",
        "section 2.1, refs 19, 87",
    ),
    "accelerometer": MethodOfCar(
        lambda car: AccelerometerIntegral(),
        "integral of a_x, with its offset from freely rolling wheels",
        "section 2.1, refs 88, 89",
    ),
    "weighted": MethodOfCar(
        lambda car: Weighted(), "Kalman filter of wheels and a_x, with offset and slope", "section 2.1, refs 90 to 92"
    ),
    "fuzzy": MethodOfCar(
        lambda car: Fuzzy(), "fuzzy rules between the wheels and the integral of a_x", "section 2.1, ref 93"
    ),
    "brake_force": MethodOfCar(
        _brake_forces,
        "integral of the forces from brake pressure and half-shaft torques",
        "section 2.2, eq 11, refs 2, 94, 95",
    ),
    "motor_force": MethodOfCar(
        lambda car: MotorForces(**keys_of(car, "speed, motor_force", FORCE_KEYS)),
        "integral of the forces from the wheel motors' torques",
        "section 2.3, eq 12, refs 34, 83, 96",
    ),
    "slip_aware": MethodOfCar(
        lambda car: with_rear_steer(_slip_aware(car), car),
        "error-state filter with slip, radii and slopes, which trusts or rejects each wheel separately",
        "sections 2.1 to 2.3; the trust is ours",
        any_steering=True,
    ),
}

RECOMMENDED = "slip_aware"


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """The mean of the wheels' speeds (m/s), held where no wheel has a measurement."""
    check_drive(f"{NAME}: do_nothing", car, recording)
    wheels = [np.asarray(recording[need.channel], float) for need in WHEEL_SPEEDS if need.channel in recording]
    if not wheels:
        return {"v_x": np.full(len(recording), np.nan)}
    said = np.isfinite(wheels)
    mean = np.where(said, wheels, 0.0).sum(0) / np.maximum(said.sum(0), 1)
    last = np.maximum.accumulate(np.where(said.any(0), np.arange(len(mean)), 0))
    return {"v_x": mean[last]}


estimate = estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
