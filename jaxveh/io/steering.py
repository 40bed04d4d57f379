"""The steer at the road wheels from that of the steering wheel, and a check that the rear wheels are not steered."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh.io.car import CarSpecification


def with_road_steer(car: CarSpecification, recording: Recording) -> Recording:
    """Return the recording with `steer` (rad, at the road wheels).

    If `recording` has none, it is `steering_wheel` over the `steering_ratio` of `car`. The recording is unchanged if it has
    `steer`, or if one of the two is missing.
    """
    if "steer" in recording or "steering_wheel" not in recording or car.steering_ratio is None:
        return recording
    return recording.replace(steer=np.asarray(recording["steering_wheel"]) / car.steering_ratio)


def check_front_steered(car: CarSpecification, who: str, advice: str = "") -> None:
    """Raise `InputError`, with more `advice`, if the rear wheels of `car` are steered, because the equations of `who` do not
    include that."""
    if not car.steers_front_alone:
        raise InputError(
            f'{who}: the car\'s file has steering = "{car.steering}", but the equations used here hold only for a car with '
            f"front steering. {advice}Make the vehicle (vehicles.specified_car) and a filter for it (estimators.state_space), "
            "which include the angles of the rear wheels, or leave the steering out of the file if the rear wheels stay straight."
        )
