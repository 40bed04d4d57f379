"""What those who add a manoeuvre build with."""

from jaxveh.manoeuvres.base import as_time
from jaxveh.manoeuvres.speed_control import AIR_DENSITY

__all__ = [
    "AIR_DENSITY",
    "as_time",
]
