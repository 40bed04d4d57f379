"""Observers: models that are pulled towards the measurements, without covariances."""

from jaxveh.observers.base import AbstractObserver, PointBelief
from jaxveh.observers.luenberger import Luenberger, SlidingMode
from jaxveh.observers.poles import linearised_step, place_poles
from jaxveh.observers.rls import RecursiveLeastSquares

__all__ = [
    "AbstractObserver",
    "Luenberger",
    "PointBelief",
    "RecursiveLeastSquares",
    "SlidingMode",
    "linearised_step",
    "place_poles",
]
