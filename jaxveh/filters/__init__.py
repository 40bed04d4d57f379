"""Filters as `lax.scan` loops behind one contract: `init`, `step`, and the driver `run`."""

from jaxveh.filters.adaptive_number import AdaptiveNumber
from jaxveh.filters.auxiliary import AuxiliaryParticleFilter
from jaxveh.filters.checkpoint import load_belief, save_belief
from jaxveh.filters.choosing import Soft, Transport
from jaxveh.filters.delayed import Delayed, DelayedBelief
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
from jaxveh.filters.marginalised import Marginalised, MarginalisedBelief
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief, ParticleFilter
from jaxveh.filters.smoothing import BackwardSampling, FixedLag, Genealogy, SmoothedEstimate, smooth
from jaxveh.filters.smoothing.parallel import smooth_parallel
from jaxveh.filters.wrappers import (
    Consider,
    Dual,
    Federated,
    Gated,
    HaarNoise,
    HInfinity,
    Huber,
    InteractingModels,
    MatchedProcess,
    Paused,
    RobustStudentT,
    SageHusa,
    ShrinkingProcess,
    StrongTracking,
    VariationalBayes,
    VaryingNoise,
)
from jaxveh.statespace.contract import AbstractBelief, AbstractFilter, Info
from jaxveh.statespace.driver import Estimate, run, scan

__all__ = [
    "AbstractBelief",
    "AbstractFilter",
    "AbstractForm",
    "AbstractGaussianFilter",
    "AbstractParticleFilter",
    "AdaptiveNumber",
    "AuxiliaryParticleFilter",
    "BackwardSampling",
    "Consider",
    "Covariance",
    "Cubature",
    "Delayed",
    "DelayedBelief",
    "Dual",
    "Ensemble",
    "EnsembleBelief",
    "Estimate",
    "Extended",
    "Federated",
    "FixedLag",
    "Gated",
    "GaussHermite",
    "GaussianBelief",
    "Genealogy",
    "Guided",
    "HInfinity",
    "HaarNoise",
    "Huber",
    "Info",
    "InteractingModels",
    "Iterated",
    "Kalman",
    "LiuWest",
    "Marginalised",
    "MarginalisedBelief",
    "MatchedProcess",
    "ParticleBelief",
    "ParticleFilter",
    "Paused",
    "Regularised",
    "RobustStudentT",
    "SageHusa",
    "ShrinkingProcess",
    "SigmaPointFilter",
    "Simplex",
    "SingularValues",
    "SmoothedEstimate",
    "Soft",
    "SquareRoot",
    "StrongTracking",
    "Transport",
    "Unscented",
    "VariationalBayes",
    "VaryingNoise",
    "export_filter",
    "load_belief",
    "run",
    "save_belief",
    "scan",
    "smooth",
    "smooth_parallel",
]
