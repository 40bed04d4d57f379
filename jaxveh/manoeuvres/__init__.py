"""Driving manoeuvres: open-loop inputs with smooth edges, closed-loop drivers, replays of recordings."""

from jaxveh.manoeuvres import kit
from jaxveh.manoeuvres.base import AbstractManoeuvre, DriverInputs, PedalInputs
from jaxveh.manoeuvres.braking import Braking, braking_in_a_turn, mu_jump_braking
from jaxveh.manoeuvres.cones import (
    Course,
    Lane,
    centre_line,
    clearance,
    cones,
    iso_3888_1,
    iso_3888_2,
    passes,
    slalom_cones,
)
from jaxveh.manoeuvres.courses import iso_lane_change, iso_obstacle_avoidance, slalom_course, steady_circle
from jaxveh.manoeuvres.cruise import Cruise, cruise
from jaxveh.manoeuvres.driver import AbstractDriver, Motion, OpenLoop, as_driver
from jaxveh.manoeuvres.named import MANOEUVRES, NamedManoeuvre, named_manoeuvre
from jaxveh.manoeuvres.options import manoeuvre_options
from jaxveh.manoeuvres.path_driver import PathDriver
from jaxveh.manoeuvres.paths import AbstractGraph, AbstractPath, Beside, Circle, LaneChanges, PathTarget, Sine, Straight
from jaxveh.manoeuvres.random_steering import RandomSteering, random_steering
from jaxveh.manoeuvres.replayed import Replay, replay
from jaxveh.manoeuvres.speed_control import SpeedControl
from jaxveh.manoeuvres.speeds import AbstractSpeed, ChangingSpeed, SteadySpeed, WaveringSpeed, wavering_speed
from jaxveh.manoeuvres.standard_steering import (
    RampSteer,
    SineWithDwell,
    Slalom,
    ramp_steer,
    sine_with_dwell,
    slalom,
)
from jaxveh.manoeuvres.steering import (
    DoubleLaneChange,
    StepSteer,
    SweptSine,
    double_lane_change,
    step_steer,
    swept_sine,
)
from jaxveh.manoeuvres.usual import USUAL, UsualDrive, options_of_car, understeer_of
from jaxveh.numerics import smooth_step

__all__ = [
    "MANOEUVRES",
    "USUAL",
    "AbstractDriver",
    "AbstractGraph",
    "AbstractManoeuvre",
    "AbstractPath",
    "AbstractSpeed",
    "Beside",
    "Braking",
    "ChangingSpeed",
    "Circle",
    "Course",
    "Cruise",
    "DoubleLaneChange",
    "DriverInputs",
    "Lane",
    "LaneChanges",
    "Motion",
    "NamedManoeuvre",
    "OpenLoop",
    "PathDriver",
    "PathTarget",
    "PedalInputs",
    "RampSteer",
    "RandomSteering",
    "Replay",
    "Sine",
    "SineWithDwell",
    "Slalom",
    "SpeedControl",
    "SteadySpeed",
    "StepSteer",
    "Straight",
    "SweptSine",
    "UsualDrive",
    "WaveringSpeed",
    "as_driver",
    "braking_in_a_turn",
    "centre_line",
    "clearance",
    "cones",
    "cruise",
    "double_lane_change",
    "iso_3888_1",
    "iso_3888_2",
    "iso_lane_change",
    "iso_obstacle_avoidance",
    "kit",
    "manoeuvre_options",
    "mu_jump_braking",
    "named_manoeuvre",
    "options_of_car",
    "passes",
    "ramp_steer",
    "random_steering",
    "replay",
    "sine_with_dwell",
    "slalom",
    "slalom_cones",
    "slalom_course",
    "smooth_step",
    "steady_circle",
    "step_steer",
    "swept_sine",
    "understeer_of",
    "wavering_speed",
]  # fmt: skip
