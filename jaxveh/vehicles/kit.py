"""The building blocks for new vehicles."""

from jaxveh.vehicles.axles import AXLES
from jaxveh.vehicles.base import innermost_car, with_batch_shape
from jaxveh.vehicles.drive import AbstractDriven
from jaxveh.vehicles.fast_states import has_fast_states
from jaxveh.vehicles.given_speed import AbstractToldSpeed
from jaxveh.vehicles.load_transfer import AbstractShiftingLoads, planar_loads
from jaxveh.vehicles.rolling_body import AbstractRollingTwoTrack
from jaxveh.vehicles.sets import CARS, FIDELITIES
from jaxveh.vehicles.shared import (
    AbstractOnAxleTyres,
    AbstractOneTrack,
    AbstractOnTyres,
    AbstractPlaneBody,
    AbstractTwoAxle,
)
from jaxveh.vehicles.small_size import small_size
from jaxveh.vehicles.steering import (
    STEER_UNITS,
    STEERINGS,
    AbstractSteeredByRoadWheels,
    axle_angles,
    steering_of,
)
from jaxveh.vehicles.traction import AbstractSpinless
from jaxveh.vehicles.two_track import AbstractLoadedTwoTrack, AbstractTwoTrack, air_drag, rolling_wheels
from jaxveh.vehicles.upright_body import AbstractUprightTwoTrack
from jaxveh.vehicles.wheels import (
    CORNERS,
    Wheels,
    body_forces,
    corners,
    each_wheel,
    travel_direction,
    wheel_names,
    wheels_of,
)

__all__ = [
    "AXLES",
    "CARS",
    "CORNERS",
    "FIDELITIES",
    "STEERINGS",
    "STEER_UNITS",
    "AbstractDriven",
    "AbstractLoadedTwoTrack",
    "AbstractOnAxleTyres",
    "AbstractOnTyres",
    "AbstractOneTrack",
    "AbstractPlaneBody",
    "AbstractRollingTwoTrack",
    "AbstractShiftingLoads",
    "AbstractSpinless",
    "AbstractSteeredByRoadWheels",
    "AbstractToldSpeed",
    "AbstractTwoAxle",
    "AbstractTwoTrack",
    "AbstractUprightTwoTrack",
    "Wheels",
    "air_drag",
    "axle_angles",
    "body_forces",
    "corners",
    "each_wheel",
    "has_fast_states",
    "innermost_car",
    "planar_loads",
    "rolling_wheels",
    "small_size",
    "steering_of",
    "travel_direction",
    "wheel_names",
    "wheels_of",
    "with_batch_shape",
]
