"""Equations of motion and outputs of one vehicle at one instant, and named parameter sets."""

from jaxveh.vehicles import kit, sets
from jaxveh.vehicles.anti_lock import AntiLock
from jaxveh.vehicles.base import GRAVITY, AbstractVehicle, Motion
from jaxveh.vehicles.commanded import Commanded
from jaxveh.vehicles.drive import AbstractDrive, AxleDrive, FourMotors
from jaxveh.vehicles.fourteen_dof import FourteenDOF
from jaxveh.vehicles.kinematic import Kinematic, KinematicOutputs, KinematicState
from jaxveh.vehicles.kinematic_crawl import KinematicCrawl
from jaxveh.vehicles.kinematic_trailer import KinematicTrailer, KinematicTrailerOutputs, KinematicTrailerState
from jaxveh.vehicles.lateral_system import LateralResponse, LateralSystem
from jaxveh.vehicles.limits import AccelerationLimits, SteerLimits
from jaxveh.vehicles.linear_handling import LinearSingleTrack, LinearSingleTrackState
from jaxveh.vehicles.linearisation import linear_single_track
from jaxveh.vehicles.load_transfer import (
    AbstractLoadTransfer,
    LaggedLoads,
    MeasuredLoads,
    QuasiStatic,
    StaticLoads,
)
from jaxveh.vehicles.longitudinal import Longitudinal, LongitudinalOutputs, LongitudinalState
from jaxveh.vehicles.parameter_sets import (
    axle_from_stiffness,
    from_specification,
    linear,
    passenger_car,
    passenger_car_as_printed,
)
from jaxveh.vehicles.roll_3dof import Roll3DOF
from jaxveh.vehicles.roll_4dof import Roll4DOF
from jaxveh.vehicles.sets import (
    CarNumbers,
    SuspensionNumbers,
    TyreNumbers,
    build,
    commonroad_limits,
    from_commonroad,
    named_car,
    numbers_of,
    specification_of,
    specified_car,
)
from jaxveh.vehicles.seven_dof import SevenDOF
from jaxveh.vehicles.single_track import SingleTrack, SingleTrackOutputs, SingleTrackState
from jaxveh.vehicles.single_track_3dof import SingleTrack3DOF
from jaxveh.vehicles.slip import regularised_speed, slip_angle
from jaxveh.vehicles.steered import Steered
from jaxveh.vehicles.steering import (
    AbstractSteering,
    Ackermann,
    FourWheelSteering,
    FrontSteering,
    IndependentSteering,
    RearSteering,
    steering_without_sideslip,
)
from jaxveh.vehicles.travelling import Travelling
from jaxveh.vehicles.two_track_2dof import TwoTrack2DOF
from jaxveh.vehicles.two_track_3dof import TwoTrack3DOF

__all__ = [
    "GRAVITY",
    "AbstractDrive",
    "AbstractLoadTransfer",
    "AbstractSteering",
    "AbstractVehicle",
    "AccelerationLimits",
    "Ackermann",
    "AntiLock",
    "AxleDrive",
    "CarNumbers",
    "Commanded",
    "FourMotors",
    "FourWheelSteering",
    "FourteenDOF",
    "FrontSteering",
    "IndependentSteering",
    "Kinematic",
    "KinematicCrawl",
    "KinematicOutputs",
    "KinematicState",
    "KinematicTrailer",
    "KinematicTrailerOutputs",
    "KinematicTrailerState",
    "LaggedLoads",
    "LateralResponse",
    "LateralSystem",
    "LinearSingleTrack",
    "LinearSingleTrackState",
    "Longitudinal",
    "LongitudinalOutputs",
    "LongitudinalState",
    "MeasuredLoads",
    "Motion",
    "QuasiStatic",
    "RearSteering",
    "Roll3DOF",
    "Roll4DOF",
    "SevenDOF",
    "SingleTrack",
    "SingleTrack3DOF",
    "SingleTrackOutputs",
    "SingleTrackState",
    "StaticLoads",
    "SteerLimits",
    "Steered",
    "SuspensionNumbers",
    "Travelling",
    "TwoTrack2DOF",
    "TwoTrack3DOF",
    "TyreNumbers",
    "axle_from_stiffness",
    "build",
    "commonroad_limits",
    "from_commonroad",
    "from_specification",
    "kit",
    "linear",
    "linear_single_track",
    "named_car",
    "numbers_of",
    "passenger_car",
    "passenger_car_as_printed",
    "regularised_speed",
    "sets",
    "slip_angle",
    "specification_of",
    "specified_car",
    "steering_without_sideslip",
]
