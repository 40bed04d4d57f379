"""What those who add an estimator build with: see `jaxveh.estimators.contract` for what one is."""

from jaxveh.estimators.contract import Need, check_needs, cut_pieces, model_of, spans_of, start_of
from jaxveh.estimators.live import AbstractCleaning, AsItIs, clean_recording

__all__ = [
    "AbstractCleaning",
    "AsItIs",
    "Need",
    "check_needs",
    "clean_recording",
    "cut_pieces",
    "model_of",
    "spans_of",
    "start_of",
]
