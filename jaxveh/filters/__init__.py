"""Filters as `lax.scan` loops behind one contract: `init`, `step`, and the driver `run`."""

from jaxveh.filters.auxiliary import AuxiliaryParticleFilter
from jaxveh.filters.base import AbstractBelief, AbstractFilter, Info
from jaxveh.filters.driver import Estimate, run, scan
from jaxveh.filters.ensemble import Ensemble, EnsembleBelief
from jaxveh.filters.gaussian import (
    AbstractForm,
    AbstractGaussianFilter,
    Covariance,
    Cubature,
    Extended,
    GaussHermite,
    GaussianBelief,
    Iterated,
    Kalman,
    SigmaPointFilter,
    Simplex,
    SingularValues,
    SquareRoot,
    Unscented,
)
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief, ParticleFilter
from jaxveh.filters.smoothing import BackwardSampling, Genealogy, SmoothedEstimate, smooth

__all__ = [
    "AbstractBelief",
    "AbstractFilter",
    "AbstractForm",
    "AbstractGaussianFilter",
    "AbstractParticleFilter",
    "AuxiliaryParticleFilter",
    "BackwardSampling",
    "Covariance",
    "Cubature",
    "Ensemble",
    "EnsembleBelief",
    "Estimate",
    "Extended",
    "GaussHermite",
    "GaussianBelief",
    "Genealogy",
    "Info",
    "Iterated",
    "Kalman",
    "ParticleBelief",
    "ParticleFilter",
    "SigmaPointFilter",
    "Simplex",
    "SingularValues",
    "SmoothedEstimate",
    "SquareRoot",
    "Unscented",
    "run",
    "scan",
    "smooth",
]
