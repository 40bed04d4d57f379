"""Observers: models that are corrected towards the measurements, without covariances."""

from jaxveh.observers.adaptive import Adaptive
from jaxveh.observers.base import AbstractObserver, PointBelief
from jaxveh.observers.contraction import contraction_rate
from jaxveh.observers.extended_state import extended_state
from jaxveh.observers.luenberger import Luenberger, SlidingMode
from jaxveh.observers.poles import linearised_step, place_poles
from jaxveh.observers.rls import RecursiveLeastSquares

__all__ = [
    "AbstractObserver",
    "Adaptive",
    "Luenberger",
    "PointBelief",
    "RecursiveLeastSquares",
    "SlidingMode",
    "contraction_rate",
    "extended_state",
    "linearised_step",
    "place_poles",
]
