"""A car's file with what a calibration of the sideslip has fitted."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from jaxveh._core.errors import check_kind, warn
from jaxveh._core.recording import Recording, check_recording
from jaxveh.estimators.contract import Calibration, several_of
from jaxveh.estimators.front_axle import front_axle
from jaxveh.estimators.rear_axle import RearAxle
from jaxveh.estimators.sideslip_score import is_measured
from jaxveh.io import AxleTyre, CarSpecification, with_road_steer
from jaxveh.io import kit as io
from jaxveh.vehicles import GRAVITY

CURVE = 1.35
"""The Magic Formula's C in a fitted car's file."""


def fitted_car(
    source: Calibration, car: CarSpecification, *, recording: Recording | Sequence[Recording] = ()
) -> CarSpecification:
    """The car's file with the fitted values in place, as far as a car file can hold them.

    If the `recording` (or several) of the calibration is given and has `steer`, the front axle's stiffness and the steer offset
    are fitted to it: see `front_axle`; otherwise they are the file's. Where the file has no `roll_gradient`, it is that of the
    fitted gain of a_y (`roll_gradient_of`). **Warns** (`JaxvehWarning`) if they stay although a
    recording is given.
    """
    io.check_car_file("fitted_car", car)
    recordings = several_of(recording)
    for one in recordings:
        check_recording("fitted_car", one)
    check_kind("fitted_car: source", source, Calibration, "estimators.sideslip.calibrate returns one.")
    fitted = source.model.system
    load = float(fitted.mass) * GRAVITY * float(fitted.front_axle_to_cg) / float(fitted.wheelbase)
    stiffness, grip = float(fitted.stiffness) * load, float(fitted.grip) * load
    rear = AxleTyre(B=stiffness / (CURVE * grip), C=CURVE, D=grip, E=0.0, nominal_load=load)
    found = dataclasses.replace(
        car,
        yaw_inertia=float(fitted.yaw_inertia),
        cg_height=float(fitted.cg_height),
        rear=rear,
        rear_cornering_stiffness=stiffness,
        roll_gradient=roll_gradient_of(car, fitted),
    )
    recordings = [with_road_steer(car, one) for one in recordings]
    steered = [one for one in recordings if is_measured(one, "steer") and is_measured(one, "a_y")]
    told, new = car.front, front_axle(source.model, steered) if steered else None
    if new is None:
        why = "the front axle cannot be fitted to steer" if steered else "no log has both steer and a_y"
        if recordings:
            kept = f"fitted_car: {why}; the file's front axle and steer_offset are kept."
            warn(kept)
        return found
    if told is not None:
        told = dataclasses.replace(told, B=told.B * new.front_cornering_stiffness / (told.B * told.C * told.D), S_h=0.0)
    return dataclasses.replace(found, front=told, **new._asdict())


def roll_gradient_of(car: CarSpecification, fitted: RearAxle) -> float | None:
    """The roll gradient of the file (rad/(m/s^2)), or else the one by which a leaning body's accelerometer has the gain of the
    `fitted` rear axle; None for a gain of at most 1. The gain contains the sensor's own error of scale, so that it does not
    replace a known roll gradient."""
    leans = (float(fitted.a_y_gain) - 1.0) / GRAVITY
    return leans if car.roll_gradient is None and leans > 0.0 else car.roll_gradient
