"""From the steering wheel to the road wheels."""

from __future__ import annotations

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.io.car import CarSpecification


def with_road_steer(car: CarSpecification, recording: Recording) -> Recording:
    """The recording with `steer` (rad, at the road wheels): its own, else `steering_wheel` over the `steering_ratio` of the car's
    file; as it is where neither is known."""
    if "steer" in recording or "steering_wheel" not in recording or car.steering_ratio is None:
        return recording
    return recording.replace(steer=np.asarray(recording["steering_wheel"]) / car.steering_ratio)
