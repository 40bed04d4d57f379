"""Equations of motion and outputs of one vehicle at one instant; named parameter sets."""

from jaxveh.vehicles.base import GRAVITY, AbstractVehicle
from jaxveh.vehicles.parameter_sets import (
    axle_from_stiffness,
    from_specification,
    linear,
    passenger_car,
    passenger_car_as_printed,
)
from jaxveh.vehicles.single_track import SingleTrack, SingleTrackOutputs, SingleTrackState
from jaxveh.vehicles.slip import regularised_speed, slip_angle

__all__ = [
    "GRAVITY",
    "AbstractVehicle",
    "SingleTrack",
    "SingleTrackOutputs",
    "SingleTrackState",
    "axle_from_stiffness",
    "from_specification",
    "linear",
    "passenger_car",
    "passenger_car_as_printed",
    "regularised_speed",
    "slip_angle",
]
