"""What those who add an estimator build with: see `jaxveh.estimators.contract` for what one is."""

from jaxveh.estimators.contract import Need, check_needs, cut_pieces, model_of, span_of
from jaxveh.estimators.live import AbstractCleaning, AsItIs, cleaned

__all__ = [
    "AbstractCleaning",
    "AsItIs",
    "Need",
    "check_needs",
    "cleaned",
    "cut_pieces",
    "model_of",
    "span_of",
]
