"""The contract between models and filters: models by name, noise laws, discretisation, chosen parameters as states."""

from jaxveh.statespace import kit
from jaxveh.statespace.belief import AbstractBelief, Info
from jaxveh.statespace.contract import (
    AbstractFilter,
    AbstractTwoPartFilter,
    AbstractTwoPartWrapper,
    AbstractWrapper,
    Gradient,
    Smoothing,
)
from jaxveh.statespace.cramer_rao import PosteriorBound, posterior_cramer_rao
from jaxveh.statespace.dependent_noise import MeasurementNoise, StateDependent
from jaxveh.statespace.disturbances import with_disturbances
from jaxveh.statespace.draw import Drawn, draw
from jaxveh.statespace.driver import Estimate, run, scan
from jaxveh.statespace.independent import Independent
from jaxveh.statespace.model import LinearInput, PerPoint, Prior, Row, StateSpace, cast
from jaxveh.statespace.noise import (
    AbstractNoise,
    CauchyGaussianMixture,
    Gaussian,
    MultivariateGaussian,
    StudentT,
)
from jaxveh.statespace.parameters import parameters_of, put_parameters, start_from, with_parameters
from jaxveh.statespace.process import AbstractProcessNoise, Continuous, Discrete
from jaxveh.statespace.solvers import RK4, Heun, Propagate, RolledRK4
from jaxveh.statespace.stabilised import StabilisedRK4
from jaxveh.statespace.uncertain_inputs import uncertain_inputs

__all__ = [
    "RK4",
    "AbstractBelief",
    "AbstractFilter",
    "AbstractNoise",
    "AbstractProcessNoise",
    "AbstractTwoPartFilter",
    "AbstractTwoPartWrapper",
    "AbstractWrapper",
    "CauchyGaussianMixture",
    "Continuous",
    "Discrete",
    "Drawn",
    "Estimate",
    "Gaussian",
    "Gradient",
    "Heun",
    "Independent",
    "Info",
    "LinearInput",
    "MeasurementNoise",
    "MultivariateGaussian",
    "PerPoint",
    "PosteriorBound",
    "Prior",
    "Propagate",
    "RolledRK4",
    "Row",
    "Smoothing",
    "StabilisedRK4",
    "StateDependent",
    "StateSpace",
    "StudentT",
    "cast",
    "draw",
    "kit",
    "parameters_of",
    "posterior_cramer_rao",
    "put_parameters",
    "run",
    "scan",
    "start_from",
    "uncertain_inputs",
    "with_disturbances",
    "with_parameters",
]
