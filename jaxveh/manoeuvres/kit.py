"""The parts for adding a manoeuvre."""

from jaxveh.manoeuvres.base import AbstractSteering, as_time
from jaxveh.manoeuvres.speed_control import AIR_DENSITY

__all__ = [
    "AIR_DENSITY",
    "AbstractSteering",
    "as_time",
]
