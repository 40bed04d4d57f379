"""A vehicle and its sensors as a state space, and ready-made answers built on it."""

from jaxveh.estimators import (
    bank,
    friction,
    geometry,
    grade,
    kit,
    learned,
    mass,
    mass_and_grade,
    navigation,
    roll,
    sideslip,
    speed,
    stiffness,
)
from jaxveh.estimators.calibration_file import read_calibration, write_calibration
from jaxveh.estimators.cleaning import clean
from jaxveh.estimators.comparison import Compared, MethodScore, compare, score_answers
from jaxveh.estimators.contract import Calibration, Span
from jaxveh.estimators.exchange import Exchange
from jaxveh.estimators.linear_baseline import open_loop, open_loop_of, open_loop_of_file
from jaxveh.estimators.live import Live, LiveAnswer, LiveBelief
from jaxveh.estimators.method import AbstractMethod, Answer, Answers, Filtered, LiveMethod
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.observability import observe, predict_measurements
from jaxveh.estimators.rear_axle import RearAxle, rear_axle_model
from jaxveh.estimators.state_space import PROCESS_NOISE, START_SPREAD, held_rows, state_space

__all__ = [
    "PROCESS_NOISE",
    "START_SPREAD",
    "AbstractMethod",
    "Answer",
    "Answers",
    "Calibration",
    "Compared",
    "Exchange",
    "Filtered",
    "Live",
    "LiveAnswer",
    "LiveBelief",
    "LiveMethod",
    "MethodOfCar",
    "MethodScore",
    "RearAxle",
    "Span",
    "bank",
    "clean",
    "compare",
    "friction",
    "geometry",
    "grade",
    "held_rows",
    "kit",
    "learned",
    "mass",
    "mass_and_grade",
    "navigation",
    "observe",
    "open_loop",
    "open_loop_of",
    "open_loop_of_file",
    "predict_measurements",
    "read_calibration",
    "rear_axle_model",
    "roll",
    "score_answers",
    "sideslip",
    "speed",
    "state_space",
    "stiffness",
    "write_calibration",
]
