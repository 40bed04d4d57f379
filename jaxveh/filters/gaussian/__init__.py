"""Gaussian filters: one algebra, with a rule that approximates functions and a form that stores the covariance."""

from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.family import (
    Cubature,
    Extended,
    GaussHermite,
    Kalman,
    SigmaPointFilter,
    Simplex,
    Unscented,
)
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.gaussian.forms import AbstractForm, Covariance, SingularValues, SquareRoot
from jaxveh.filters.gaussian.iterated import Iterated

__all__ = [
    "AbstractForm",
    "AbstractGaussianFilter",
    "Covariance",
    "Cubature",
    "Extended",
    "GaussHermite",
    "GaussianBelief",
    "Iterated",
    "Kalman",
    "SigmaPointFilter",
    "Simplex",
    "SingularValues",
    "SquareRoot",
    "Unscented",
]
