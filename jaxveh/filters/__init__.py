"""Filters as `lax.scan` loops behind one contract: `init`, `step`, and the driver `run`."""

from jaxveh.filters.auxiliary import AuxiliaryParticleFilter
from jaxveh.filters.base import AbstractBelief, AbstractFilter, Info
from jaxveh.filters.driver import Estimate, run, scan
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief, ParticleFilter
from jaxveh.filters.unscented import GaussianBelief, Unscented

__all__ = [
    "AbstractBelief",
    "AbstractFilter",
    "AbstractParticleFilter",
    "AuxiliaryParticleFilter",
    "Estimate",
    "GaussianBelief",
    "Info",
    "ParticleBelief",
    "ParticleFilter",
    "Unscented",
    "run",
    "scan",
]
