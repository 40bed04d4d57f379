"""Models of cars on four wheels for filters, with and without body roll (section 1.2.1)."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax.numpy as jnp

from jaxveh import filters, numerics, tyres
from jaxveh._core.names import record, record_type
from jaxveh.estimators.car_file import keys_of
from jaxveh.estimators.contract import Need
from jaxveh.estimators.sideslip_methods.common import (
    ROLL_RATE,
    STEER,
    V_X,
    Guarded,
    guard,
    slowest_of,
    straight_steer,
)
from jaxveh.estimators.sideslip_methods.kinematic import AtSpeed
from jaxveh.estimators.sideslip_methods.single_track import (
    A_Y_NOISE,
    SENSORS,
    STEP,
    USUAL_SPEED,
    YAW_RATE_NOISE,
    Lateral,
    LateralReport,
    axles_of,
    full_state,
    in_filter,
    lateral_model,
    process_noise,
    report,
    single_track,
    transition,
)
from jaxveh.io import CarSpecification
from jaxveh.statespace import Continuous, Gaussian, Prior, StateSpace
from jaxveh.vehicles import (
    GRAVITY,
    CarNumbers,
    QuasiStatic,
    Roll3DOF,
    Roll4DOF,
    TwoTrack2DOF,
    build,
    numbers_of,
    sets,
)

STIFFEST = 2.0
"""Load at which a wheel's cornering stiffness is greatest, over its static load: lateral load transfer softens an axle."""

UNSPRUNG = 0.025
"""Unsprung mass at a wheel over the car's mass."""

RADIUS_SHARE = 0.12
"""A wheel's radius over the wheelbase, where the car's file has no radius."""

ROLL_RATE_NOISE, ROLL_ERROR = 0.01, 0.05
"""rad/s: noise of the gyroscope; rad/s per root second: disturbance of the body's roll rate by uneven roads."""

SPEED_NOISE, SPEED_ERROR = 0.05, 0.3
"""m/s: noise of the measured speed; m/s per root second: forces that are not in the torques."""

PEDALS = tuple(Need(f"{name}_torque", "N m", throughout=True) for name in ("drive", "brake"))

LEANING = ("v_y", "yaw_rate", "roll", "roll_rate")


def wheel_options(car: CarSpecification) -> dict[str, Any]:
    """The tyres of a wheel on each axle: half of the axle's Magic Formula, scaled by load (`tyres.Similarity`)."""
    found = {}
    for name, axle in zip(("front", "rear"), axles_of(single_track(car)), strict=True):
        tyre, load = axle.tyre, 0.5 * axle.load
        share = 0.5 * axle.grip / tyre.D
        half = dataclasses.replace(tyre, D=share * tyre.D, S_v=share * tyre.S_v, nominal_load=load)
        found[name] = tyres.Similarity(half, load, STIFFEST * load)
    return found


def car_numbers(car: CarSpecification, who: str, *, leaning: bool) -> CarNumbers:
    """The parameters of a car on four wheels; `leaning`: with an ordinary suspension.

    **Raises** `InputError` for a file without a height of the centre of gravity, or tracks.
    """
    keys_of(car, f"sideslip: {who}", dict.fromkeys(("cg_height", "track_front", "track_rear"), "m"))
    found = numbers_of(car)
    if not leaning:
        return found
    same = ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "cg_height", "track_front", "track_rear")
    radius = RADIUS_SHARE * car.wheelbase if car.wheel_radius is None else car.wheel_radius
    unsprung = dict.fromkeys(("unsprung_mass_front", "unsprung_mass_rear"), UNSPRUNG * car.mass)
    body = sets.estimated_suspension(**{name: getattr(car, name) for name in same}, wheel_radius=radius, **unsprung)
    return dataclasses.replace(found, wheel_radius=radius, suspension=body)


def two_track(car: CarSpecification) -> Guarded:
    """Makes the unscented filter of the car on four wheels without body roll, at a given speed: two degrees of freedom (the
    review's [19]), with lateral load transfer."""
    numbers = car_numbers(car, "the two-track car", leaning=False)
    vehicle = build(numbers, TwoTrack2DOF, load_transfer=QuasiStatic(), **wheel_options(car))
    model = lateral_model(vehicle, slowest_of(car))
    return in_filter(car, model, filters.Unscented(), cleaning=straight_steer(car))


def leaning_observation(system: Lateral, t, x, u):
    """The measurements of sensors on the rolling body, whose accelerometer also measures gravity; and the speed."""
    outputs = system.car.outputs(t, full_state(system.car, x), u)
    felt = outputs.a_y * numerics.cos(x.roll) + GRAVITY * numerics.sin(x.roll)
    seen = {"yaw_rate": x.yaw_rate, "a_y": felt, "roll_rate": x.roll_rate, "v_x": outputs.v_x}
    return record("Measurements", seen)


def _leaning_model(vehicle: Any, car: CarSpecification, *, driven: bool = False) -> StateSpace:
    """A state space with v_y, yaw rate, roll and roll rate as states; `driven`: with the speed, too."""
    noise = process_noise(vehicle) | {"roll_rate": ROLL_ERROR}
    seen = {"yaw_rate": YAW_RATE_NOISE, "a_y": A_Y_NOISE, "roll_rate": ROLL_RATE_NOISE}
    spread, states, start = {"v_y": 0.5, "yaw_rate": 0.1, "roll": 0.05, "roll_rate": 0.1}, LEANING, [0.0] * 4
    if driven:
        noise, seen, spread = ({"v_x": one} | rest for one, rest in (
            (SPEED_ERROR, noise), (SPEED_NOISE, seen), (1.0, spread)
        ))  # fmt: skip
        states, start = ("v_x", *LEANING), [USUAL_SPEED, *start]
    return StateSpace(
        system=Lateral(vehicle, slowest_of(car)),
        transition=driven_transition if driven else transition,
        observation=leaning_observation,
        report=report,
        process_noise=Continuous(Gaussian(noise)),
        measurement_noise=Gaussian(seen),
        prior=Prior(record_type("LeaningState", states)(*start), Gaussian(spread)),
        inputs=("steer", *[need.channel for need in PEDALS]) if driven else ("steer", "v_x"),
    )


def roll_3dof(car: CarSpecification) -> Guarded:
    """Makes the unscented filter of the car with body roll, at a given speed: three degrees of freedom (the review's [22]). A
    measured roll rate is used if available."""
    numbers = car_numbers(car, "the leaning car", leaning=True)
    vehicle = build(numbers, Roll3DOF, load_transfer=QuasiStatic(), **wheel_options(car))
    more = (ROLL_RATE._replace(optional=True),)
    return in_filter(car, _leaning_model(vehicle, car), filters.Unscented(), more=more, cleaning=straight_steer(car))


def driven_transition(system: Lateral, t0, t1, x, u):
    """The state after a step; below `slowest` the wheels roll without slip."""
    moved = STEP(system, t0, t1, x, u)
    car: Any = system.car
    yaw_rate = moved.v_x * u.steer / car.wheelbase
    rolling = moved._replace(v_y=car.rear_axle_to_cg * yaw_rate, yaw_rate=yaw_rate)
    return type(x)(*[jnp.where(moved.v_x >= system.slowest, a, b) for a, b in zip(moved, rolling, strict=True)])


def roll_4dof(car: CarSpecification) -> Guarded:
    """Makes the unscented filter of the car with body roll that is driven by torques: four degrees of freedom (the review's
    [23]). The speed is a state, and is measured."""
    numbers = car_numbers(car, "the leaning car", leaning=True)
    vehicle = build(numbers, Roll4DOF, load_transfer=QuasiStatic(), **wheel_options(car))
    model = _leaning_model(vehicle, car, driven=True)
    needs = (V_X, STEER, *SENSORS, ROLL_RATE._replace(optional=True), *PEDALS)
    inner = AtSpeed(model, filters.Unscented(), needs, straight_steer(car), shown=LateralReport._fields)
    return guard(car, inner, SENSORS, claims=False)
