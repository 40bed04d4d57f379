"""What a car measures: channels, noise laws, mounting position, low-pass filters."""

from jaxveh.sensors.instrumented import Instrumented
from jaxveh.sensors.low_pass import LowPass, low_pass
from jaxveh.sensors.sensor_set import Position, SensorSet, esc

__all__ = ["Instrumented", "LowPass", "Position", "SensorSet", "esc", "low_pass"]
