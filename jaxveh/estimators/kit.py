"""What those who add an estimator build with."""

from jaxveh.estimators.cleaning import BLIND_CHANNELS
from jaxveh.estimators.sideslip import PIECE_LENGTH, WARM_UP, cut_pieces

__all__ = [
    "BLIND_CHANNELS",
    "PIECE_LENGTH",
    "WARM_UP",
    "cut_pieces",
]
