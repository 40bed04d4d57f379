"""The parts for adding a manoeuvre."""

from jaxveh.manoeuvres.base import FASTEST, AbstractSteering, as_time, check_speed, check_steer_deg
from jaxveh.manoeuvres.speed_control import AIR_DENSITY

__all__ = [
    "AIR_DENSITY",
    "FASTEST",
    "AbstractSteering",
    "as_time",
    "check_speed",
    "check_steer_deg",
]
