"""A vehicle and its sensors as a state space, and ready-made answers built on it."""

from jaxveh.estimators import kit, mass_and_grade, sideslip
from jaxveh.estimators.cleaning import clean
from jaxveh.estimators.contract import Calibration
from jaxveh.estimators.handling import Handling, handling_model
from jaxveh.estimators.linear_baseline import open_loop
from jaxveh.estimators.live import Live, LiveAnswer, LiveBelief
from jaxveh.estimators.observability import observe, predict_measurements
from jaxveh.estimators.state_space import PROCESS_NOISE, START_SPREAD, held_rows, state_space

__all__ = [
    "PROCESS_NOISE",
    "START_SPREAD",
    "Calibration",
    "Handling",
    "Live",
    "LiveAnswer",
    "LiveBelief",
    "clean",
    "handling_model",
    "held_rows",
    "kit",
    "mass_and_grade",
    "observe",
    "open_loop",
    "predict_measurements",
    "sideslip",
    "state_space",
]
