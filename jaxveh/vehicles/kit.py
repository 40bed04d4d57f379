"""What those who add a vehicle build with."""

from jaxveh.vehicles.load_transfer import planar_loads
from jaxveh.vehicles.sets import CARS, FIDELITIES
from jaxveh.vehicles.two_track import air_drag, positions_of, rolling_wheels
from jaxveh.vehicles.wheels import Wheels, body_forces, each_wheel, travel_direction, wheel_names, wheels_of

__all__ = [
    "CARS",
    "FIDELITIES",
    "Wheels",
    "air_drag",
    "body_forces",
    "each_wheel",
    "planar_loads",
    "positions_of",
    "rolling_wheels",
    "travel_direction",
    "wheel_names",
    "wheels_of",
]
