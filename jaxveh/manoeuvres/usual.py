"""Typical speeds and steer angles of named manoeuvres, and options that follow from the car."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh import vehicles
from jaxveh._core.errors import check_kind
from jaxveh.manoeuvres.options import manoeuvre_options

KMH = 1 / 3.6


class UsualDrive(NamedTuple):
    """Typical speed (m/s) and steer (degrees at the road wheels) of a manoeuvre."""

    speed: float
    steer_deg: float


USUAL: dict[str, UsualDrive] = {
    "double-lane-change": UsualDrive(25.0, 7.0),
    "step-steer": UsualDrive(25.0, 2.0),
    "swept-sine": UsualDrive(25.0, 1.0),
    "sine-with-dwell": UsualDrive(80 * KMH, 6.0),
    "ramp-steer": UsualDrive(25.0, 3.0),
    "slalom": UsualDrive(16.0, 3.0),
    "random-steering": UsualDrive(25.0, 0.7),
    "braking-in-a-turn": UsualDrive(25.0, 2.0),
    "mu-jump-braking": UsualDrive(25.0, 0.0),
    "cruise": UsualDrive(25.0, 0.0),
    "iso-lane-change": UsualDrive(80 * KMH, 0.0),
    "iso-obstacle-avoidance": UsualDrive(45 * KMH, 0.0),
    "slalom-course": UsualDrive(14.0, 0.0),
    "steady-circle": UsualDrive(16.0, 0.0),
}
"""Typical speed and steer of each manoeuvre, by its name in `MANOEUVRES`."""


def options_of_car(name: str, car: Any) -> dict[str, float]:
    """The options of the manoeuvre `name` that follow from the car: mass and wheel radius for braking, wheelbase and
    understeer gradient for a driver on a path. Of a car inside another (`AntiLock`, `Steered`, ...) they are the inner one's.

    **Raises** `InputError` for an unknown name, and for what is no car.
    """
    check_kind("car", car, vehicles.AbstractVehicle, "Such as vehicles.passenger_car().")
    car = vehicles.kit.innermost_car(car)
    known = manoeuvre_options(name)
    found = {part: getattr(car, part, None) for part in ("mass", "wheel_radius")}
    if hasattr(car, "front_axle_to_cg") and hasattr(car, "rear_axle_to_cg"):
        found["wheelbase"] = car.front_axle_to_cg + car.rear_axle_to_cg
    if "understeer_gradient" in known:
        found["understeer_gradient"] = understeer_of(car)
    return {part: float(value) for part, value in found.items() if part in known and value is not None}


def understeer_of(car: Any) -> Any:
    """The understeer gradient of the car with its tyres' linear slopes, rad s^2/m; None for a car without tyres.
    Of a car inside another it is the inner one's.

    **Raises** `InputError` for what is no car.
    """
    check_kind("car", car, vehicles.AbstractVehicle, "Such as vehicles.passenger_car().")
    car = vehicles.kit.innermost_car(car)
    if isinstance(car, vehicles.LinearSingleTrack):
        return car.understeer_gradient
    return vehicles.linear_single_track(car).understeer_gradient if hasattr(car, "front") else None
