"""The parts for adding an estimator: see `jaxveh.estimators.contract` for its definition."""

from jaxveh.estimators.catalogue import FULL_CAR, catalogue, keys_asked, keys_used
from jaxveh.estimators.contract import Need, check_needs, cut_pieces, in_words, model_of, spans_of, start_of
from jaxveh.estimators.following import follow, follow_rows, smooth_rows
from jaxveh.estimators.live import AbstractCleaning, AsItIs, clean_recording
from jaxveh.estimators.method import AbstractSmoothable, answer
from jaxveh.estimators.method_of_car import method_of
from jaxveh.estimators.misfit import Misfit, Roughness, learn_misfit, learn_roughness, no_misfit, no_roughness
from jaxveh.estimators.sequential import Belief, Measurement, belief_of, correct, correct_by_each, move, spread_of

__all__ = [
    "FULL_CAR",
    "AbstractCleaning",
    "AbstractSmoothable",
    "AsItIs",
    "Belief",
    "Measurement",
    "Misfit",
    "Need",
    "Roughness",
    "answer",
    "belief_of",
    "catalogue",
    "check_needs",
    "clean_recording",
    "correct",
    "correct_by_each",
    "cut_pieces",
    "follow",
    "follow_rows",
    "in_words",
    "keys_asked",
    "keys_used",
    "learn_misfit",
    "learn_roughness",
    "method_of",
    "model_of",
    "move",
    "no_misfit",
    "no_roughness",
    "smooth_rows",
    "spans_of",
    "spread_of",
    "start_of",
]
