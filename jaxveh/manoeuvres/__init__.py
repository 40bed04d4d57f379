"""What the driver does over time: open-loop steering inputs with smooth edges, and the replay of a recording."""

from jaxveh.manoeuvres.base import AbstractManoeuvre, DriverInputs, smooth_step
from jaxveh.manoeuvres.replayed import Replay, replay
from jaxveh.manoeuvres.steering import (
    DoubleLaneChange,
    StepSteer,
    SweptSine,
    double_lane_change,
    step_steer,
    swept_sine,
)

__all__ = [
    "AbstractManoeuvre",
    "DoubleLaneChange",
    "DriverInputs",
    "Replay",
    "StepSteer",
    "SweptSine",
    "double_lane_change",
    "replay",
    "smooth_step",
    "step_steer",
    "swept_sine",
]
