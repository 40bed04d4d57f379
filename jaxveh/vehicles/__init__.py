"""Equations of motion and outputs of one vehicle at one instant; named parameter sets."""

from jaxveh.vehicles.base import GRAVITY, AbstractVehicle, Motion
from jaxveh.vehicles.drive import AbstractDrive, AxleDrive, FourMotors
from jaxveh.vehicles.fourteen_dof import FourteenDOF
from jaxveh.vehicles.load_transfer import (
    AbstractLoadTransfer,
    LaggedLoads,
    MeasuredLoads,
    QuasiStatic,
    StaticLoads,
)
from jaxveh.vehicles.parameter_sets import (
    axle_from_stiffness,
    from_specification,
    linear,
    passenger_car,
    passenger_car_as_printed,
)
from jaxveh.vehicles.seven_dof import SevenDOF
from jaxveh.vehicles.single_track import SingleTrack, SingleTrackOutputs, SingleTrackState
from jaxveh.vehicles.slip import regularised_speed, slip_angle
from jaxveh.vehicles.travelling import Travelling

__all__ = [
    "GRAVITY",
    "AbstractDrive",
    "AbstractLoadTransfer",
    "AbstractVehicle",
    "AxleDrive",
    "FourMotors",
    "FourteenDOF",
    "LaggedLoads",
    "MeasuredLoads",
    "Motion",
    "QuasiStatic",
    "SevenDOF",
    "SingleTrack",
    "SingleTrackOutputs",
    "SingleTrackState",
    "StaticLoads",
    "Travelling",
    "axle_from_stiffness",
    "from_specification",
    "linear",
    "passenger_car",
    "passenger_car_as_printed",
    "regularised_speed",
    "slip_angle",
]
