"""A vehicle and its sensors as a state space, and ready-made answers built on it."""

from jaxveh.estimators.observability import observe, predict_measurements
from jaxveh.estimators.state_space import PROCESS_NOISE, START_SPREAD, held_rows, state_space

__all__ = ["PROCESS_NOISE", "START_SPREAD", "held_rows", "observe", "predict_measurements", "state_space"]
