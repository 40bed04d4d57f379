"""The angles of the road wheels that follow from those of a log, and a check that the rear wheels are not steered."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording, check_recording
from jaxveh.io.car import CarSpecification, check_car_file

USUAL_MIDDLE_SPEED = 20.0
"""m/s: the speed at which a ratio is halfway between the two of a car's file, if the file does not say."""


def with_road_steer(car: CarSpecification, recording: Recording) -> Recording:
    """Return the recording with `steer` (rad, at the road wheels) and, if the rear wheels of `car` are steered, `steer_rear`.

    If `recording` has no `steer`, it is `steering_wheel` over the `steering_ratio` of `car`, or the mean of `steer_fl` and
    `steer_fr`. If it has no value of `steer_rear`, that is the mean of `steer_rl` and `steer_rr`, or for a "four-wheel" steering
    the file's ratio times `steer` less its offset. The recording is unchanged if nothing is to be added, or what is needed is
    missing.
    """
    check_car_file("with_road_steer", car)
    check_recording("with_road_steer", recording)
    made: dict[str, Any] = {}
    values = lambda name: np.asarray(recording[name])
    given = lambda *names: all(name in recording and np.isfinite(values(name)).any() for name in names)
    if "steer" in recording:
        made["steer"] = values("steer")
    elif "steering_wheel" in recording and car.steering_ratio is not None:
        made["steer"] = values("steering_wheel") / car.steering_ratio
    elif given("steer_fl", "steer_fr"):
        made["steer"] = 0.5 * (values("steer_fl") + values("steer_fr"))
    if not (car.steers_front_alone or given("steer_rear")):
        if given("steer_rl", "steer_rr"):
            made["steer_rear"] = 0.5 * (values("steer_rl") + values("steer_rr"))
        elif car.steering == "four-wheel" and "steer" in made and (given("v_x") or car.rear_steer_ratio_fast is None):
            speed = values("v_x") if given("v_x") else 0.0
            ratio = rear_ratio(car.rear_steer_ratio, car.rear_steer_ratio_fast, car.rear_steer_speed, speed)
            made["steer_rear"] = ratio * (made["steer"] - (car.steer_offset or 0.0))
    new = {name: one for name, one in made.items() if name == "steer_rear" or name not in recording}
    return recording.replace(**new) if new else recording


def rear_ratio(slow: Any, fast: Any, middle_speed: Any, v_x: Any) -> Any:
    """Return the angle of the rear wheels over that of the front wheels (-) at a speed `v_x` (m/s): `slow` at standstill, `fast`
    at high speed (None: `slow` at all speeds), halfway between them at `middle_speed` (None: `USUAL_MIDDLE_SPEED`)."""
    if fast is None:
        return slow
    middle_speed = USUAL_MIDDLE_SPEED if middle_speed is None else middle_speed
    square = v_x * v_x * (1.0 / (middle_speed * middle_speed))
    return (slow + fast * square) / (1.0 + square)


def check_front_steered(car: CarSpecification, who: str, advice: str = "") -> None:
    """Raise `InputError`, with more `advice`, if the rear wheels of `car` are steered, because the equations of `who` do not
    include that."""
    check_car_file(who, car)
    if not car.steers_front_alone:
        raise InputError(
            f'{who}: the car\'s file has steering = "{car.steering}", but the equations used here hold only for a car with '
            f"front steering. {advice}Make the vehicle (vehicles.specified_car) and a filter for it (estimators.state_space), "
            "which include the angles of the rear wheels, or leave the steering out of the file if the rear wheels stay straight."
        )
