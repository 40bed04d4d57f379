"""The one contract that a filter sees: models by name, noise laws, discretisation, chosen parameters as states."""

from jaxveh.statespace.disturbances import with_disturbances
from jaxveh.statespace.driver import Estimate, run, scan
from jaxveh.statespace.model import LinearInput, PerPoint, Prior, Row, StateSpace, cast
from jaxveh.statespace.noise import (
    AbstractNoise,
    CauchyGaussianMixture,
    Gaussian,
    Independent,
    MultivariateGaussian,
    StudentT,
)
from jaxveh.statespace.parameters import parameter_view, put_parameters, start_from, with_parameters
from jaxveh.statespace.process import AbstractProcessNoise, Continuous, Discrete
from jaxveh.statespace.solvers import RK4, Heun, Propagate, RolledRK4

__all__ = [
    "RK4",
    "AbstractNoise",
    "AbstractProcessNoise",
    "CauchyGaussianMixture",
    "Continuous",
    "Discrete",
    "Estimate",
    "Gaussian",
    "Heun",
    "Independent",
    "LinearInput",
    "MultivariateGaussian",
    "PerPoint",
    "Prior",
    "Propagate",
    "RolledRK4",
    "Row",
    "StateSpace",
    "StudentT",
    "cast",
    "parameter_view",
    "put_parameters",
    "run",
    "scan",
    "start_from",
    "with_disturbances",
    "with_parameters",
]
