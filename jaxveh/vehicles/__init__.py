"""Equations of motion and outputs of one vehicle at one instant; named parameter sets."""

from jaxveh.vehicles.base import GRAVITY, AbstractVehicle, Motion
from jaxveh.vehicles.drive import AbstractDrive, AxleDrive, FourMotors
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
from jaxveh.vehicles.roll_3dof import Roll3DOF
from jaxveh.vehicles.roll_4dof import Roll4DOF
from jaxveh.vehicles.seven_dof import SevenDOF
from jaxveh.vehicles.single_track import SingleTrack, SingleTrackOutputs, SingleTrackState
from jaxveh.vehicles.single_track_3dof import SingleTrack3DOF
from jaxveh.vehicles.slip import regularised_speed, slip_angle
from jaxveh.vehicles.steered import Steered
from jaxveh.vehicles.travelling import Travelling
from jaxveh.vehicles.two_track_2dof import TwoTrack2DOF
from jaxveh.vehicles.two_track_3dof import TwoTrack3DOF

__all__ = [
    "GRAVITY",
    "AbstractDrive",
    "AbstractLoadTransfer",
    "AbstractVehicle",
    "AxleDrive",
    "FourMotors",
    "LaggedLoads",
    "MeasuredLoads",
    "Motion",
    "QuasiStatic",
    "Roll3DOF",
    "Roll4DOF",
    "SevenDOF",
    "SingleTrack",
    "SingleTrack3DOF",
    "SingleTrackOutputs",
    "SingleTrackState",
    "StaticLoads",
    "Steered",
    "Travelling",
    "TwoTrack2DOF",
    "TwoTrack3DOF",
    "axle_from_stiffness",
    "from_specification",
    "linear",
    "passenger_car",
    "passenger_car_as_printed",
    "regularised_speed",
    "slip_angle",
]
