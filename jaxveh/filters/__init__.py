"""Filters as `lax.scan` loops behind one contract: `init`, `step`, and the driver `run`."""

from jaxveh.filters.auxiliary import AuxiliaryParticleFilter
from jaxveh.filters.checkpoint import load_belief, save_belief
from jaxveh.filters.ensemble import Ensemble, EnsembleBelief
from jaxveh.filters.export import export_filter
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
from jaxveh.filters.guided import Guided
from jaxveh.filters.kernels import LiuWest, Regularised
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief, ParticleFilter
from jaxveh.filters.smoothing import BackwardSampling, Genealogy, SmoothedEstimate, smooth
from jaxveh.filters.smoothing.parallel import smooth_parallel
from jaxveh.filters.wrappers import (
    Consider,
    Dual,
    Federated,
    Gated,
    HInfinity,
    Huber,
    InteractingModels,
    Paused,
    RobustStudentT,
    SageHusa,
    StrongTracking,
    VariationalBayes,
)
from jaxveh.statespace.contract import AbstractBelief, AbstractFilter, Info
from jaxveh.statespace.driver import Estimate, run, scan

__all__ = [
    "AbstractBelief",
    "AbstractFilter",
    "AbstractForm",
    "AbstractGaussianFilter",
    "AbstractParticleFilter",
    "AuxiliaryParticleFilter",
    "BackwardSampling",
    "Consider",
    "Covariance",
    "Cubature",
    "Dual",
    "Ensemble",
    "EnsembleBelief",
    "Estimate",
    "Extended",
    "Federated",
    "Gated",
    "GaussHermite",
    "GaussianBelief",
    "Genealogy",
    "Guided",
    "HInfinity",
    "Huber",
    "Info",
    "InteractingModels",
    "Iterated",
    "Kalman",
    "LiuWest",
    "ParticleBelief",
    "ParticleFilter",
    "Paused",
    "Regularised",
    "RobustStudentT",
    "SageHusa",
    "SigmaPointFilter",
    "Simplex",
    "SingularValues",
    "SmoothedEstimate",
    "SquareRoot",
    "StrongTracking",
    "Unscented",
    "VariationalBayes",
    "export_filter",
    "load_belief",
    "run",
    "save_belief",
    "scan",
    "smooth",
    "smooth_parallel",
]
