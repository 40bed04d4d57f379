"""From the steering wheel to the road wheels, and for whom the rear ones must not turn."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh.io.car import CarSpecification


def with_road_steer(car: CarSpecification, recording: Recording) -> Recording:
    """The recording with `steer` (rad, at the road wheels): its own, else `steering_wheel` over the `steering_ratio` of the car's
    file; as it is where neither is known."""
    if "steer" in recording or "steering_wheel" not in recording or car.steering_ratio is None:
        return recording
    return recording.replace(steer=np.asarray(recording["steering_wheel"]) / car.steering_ratio)


def check_front_steered(car: CarSpecification, who: str) -> None:
    """Raise `InputError` for a car whose rear wheels are steered, which is not in the equations of `who` asks."""
    if not car.steers_front_alone:
        raise InputError(
            f'{who}: the car\'s file says steering = "{car.steering}": its equations are those of a car whose front wheels alone '
            "are steered. Make the vehicle (vehicles.specified_car) and a filter on it (estimators.state_space), which know the "
            "rear wheels' angles, or leave the steering out of the file where they stay straight."
        )
