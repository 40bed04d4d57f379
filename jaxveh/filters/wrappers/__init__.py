"""Filters around filters: estimated noises, outliers, gated sensors, federated filters, models that change."""

from jaxveh.filters.wrappers.considered import Consider, Dual
from jaxveh.filters.wrappers.contaminated import Contaminated
from jaxveh.filters.wrappers.federated import Federated
from jaxveh.filters.wrappers.gated import Gated
from jaxveh.filters.wrappers.h_infinity import HInfinity
from jaxveh.filters.wrappers.interacting import InteractingModels
from jaxveh.filters.wrappers.measurement_noise import SageHusa, VariationalBayes
from jaxveh.filters.wrappers.paused import Paused
from jaxveh.filters.wrappers.process_noise import MatchedProcess, ShrinkingProcess
from jaxveh.filters.wrappers.robust import Huber, RobustStudentT
from jaxveh.filters.wrappers.strong_tracking import StrongTracking
from jaxveh.filters.wrappers.varying_noise import VaryingNoise
from jaxveh.filters.wrappers.wavelet import HaarNoise, HaarParticles

__all__ = [
    "Consider",
    "Contaminated",
    "Dual",
    "Federated",
    "Gated",
    "HInfinity",
    "HaarNoise",
    "HaarParticles",
    "Huber",
    "InteractingModels",
    "MatchedProcess",
    "Paused",
    "RobustStudentT",
    "SageHusa",
    "ShrinkingProcess",
    "StrongTracking",
    "VariationalBayes",
    "VaryingNoise",
]
