"""The numbers of a car from a CommonRoad specification."""

from __future__ import annotations

from typing import Any

from jaxveh._core.errors import InputError, check_has, check_kind
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.limits import AccelerationLimits, SteerLimits
from jaxveh.vehicles.sets.numbers import NAMED_ALIKE, CarNumbers, SuspensionNumbers, TyreNumbers, named_alike

READ = "io.read_commonroad reads one from a file."
"""What makes a specification."""


def from_commonroad(specification: Any, name: str = "CommonRoad vehicle", source: str = "CommonRoad") -> CarNumbers:
    """The numbers of a `jaxveh.io.CommonRoadSpecification`, for `build`.

    As in CommonRoad's own single-track models, the distances of the axles from the centre of gravity of the sprung mass are used
    for the whole car. Tyres have the cornering stiffness `-p_ky1 F_z`, the slip stiffness `p_kx1 F_z` and the friction `p_dy1`.
    Unsprung masses are halved, and the stiffness of an anti-roll bar at the wheels is `-K_ts / T^2`. The yaw inertia of the
    sprung mass is that of the car less that of wheels and axles as point masses at the wheels. If masses are missing (a tractor
    with a trailer), only kinematic cars can be built.
    """
    s = specification
    check_kind("name", name, str)
    check_kind("source", source, str)
    check_has("specification", s, ("tyre", "trailer_wheelbase", *NAMED_ALIKE), READ)
    weight = None if s.mass is None else 0.5 * s.mass * GRAVITY / (s.front_axle_to_cg + s.rear_axle_to_cg)
    tyres = {"front": None, "rear": None}
    if s.tyre is not None and weight is not None:
        for axle, lever in (("front", s.rear_axle_to_cg), ("rear", s.front_axle_to_cg)):
            tyres[axle] = _tyre(s.tyre, weight * lever)
    return CarNumbers(
        name=name,
        source=source,
        **named_alike(s),
        front=tyres["front"],
        rear=tyres["rear"],
        cg_height=s.cg_height,
        suspension=_suspension(s),
        trailer_length=s.trailer_wheelbase,
    )


def commonroad_limits(specification: Any) -> tuple[SteerLimits, AccelerationLimits]:
    """The limits of steering and acceleration of a `jaxveh.io.CommonRoadSpecification`, for `Commanded`.

    **Raises** `InputError` with the limits that are missing from the specification.
    """
    steering = ("steer_min", "steer_max", "steer_rate_min", "steer_rate_max")
    driving = ("acceleration_max", "switching_speed", "speed_min", "speed_max")
    check_has("specification", specification, (*steering, *driving), READ)
    missing = [name for name in (*steering, *driving) if getattr(specification, name) is None]
    if missing:
        raise InputError(f"limits of the vehicle: {', '.join(missing)} missing from the specification.")
    return (
        SteerLimits(*[getattr(specification, name) for name in steering]),
        AccelerationLimits(*[getattr(specification, name) for name in driving]),
    )


def _tyre(coefficients, load: float) -> TyreNumbers:
    missing = [name for name in ("p_ky1", "p_kx1", "p_dy1", "p_dx1", "p_cy1", "p_cx1") if name not in coefficients]
    if missing:
        raise InputError(f"tire: {', '.join(missing)} missing from the specification.")
    return TyreNumbers(
        cornering_stiffness=-coefficients["p_ky1"] * load,
        slip_stiffness=coefficients["p_kx1"] * load,
        friction=coefficients["p_dy1"],
        coefficients={name.replace("_", "").upper(): value for name, value in coefficients.items()},
    )


NEEDED = (
    *("sprung_mass", "unsprung_mass_front", "unsprung_mass_rear", "roll_inertia", "pitch_inertia", "yaw_inertia"),
    *("sprung_cg_height", "track_front", "track_rear", "spring_front", "spring_rear", "damper_front", "damper_rear"),
    "tyre_stiffness",
)


def _suspension(s: Any) -> SuspensionNumbers | None:
    if any(getattr(s, name) is None for name in NEEDED):
        return None
    a, b, front, rear = s.front_axle_to_cg, s.rear_axle_to_cg, s.unsprung_mass_front, s.unsprung_mass_rear
    outside = front * (a**2 + 0.25 * s.track_front**2) + rear * (b**2 + 0.25 * s.track_rear**2)
    return SuspensionNumbers(
        sprung_mass=s.sprung_mass,
        unsprung_mass_front=0.5 * front,
        unsprung_mass_rear=0.5 * rear,
        roll_inertia=s.roll_inertia,
        pitch_inertia=s.pitch_inertia,
        yaw_inertia=s.yaw_inertia - outside,
        roll_yaw_product=s.roll_yaw_product or 0.0,
        front_axle_to_cg=a,
        rear_axle_to_cg=b,
        cg_height=s.sprung_cg_height,
        spring_front=s.spring_front,
        spring_rear=s.spring_rear,
        damper_front=s.damper_front,
        damper_rear=s.damper_rear,
        tyre_stiffness=s.tyre_stiffness,
        anti_roll_front=-(s.torsion_front or 0.0) / s.track_front**2,
        anti_roll_rear=-(s.torsion_rear or 0.0) / s.track_rear**2,
        roll_centre_front=s.roll_centre_front or 0.0,
        roll_centre_rear=s.roll_centre_rear or 0.0,
    )
