"""Qin et al. (2014): a particle filter with wavelet variances, a Cauchy-Gaussian likelihood and a learned transition."""

from jaxveh.experiments.model_adaptive_pf.criteria import CRITERIA
from jaxveh.experiments.model_adaptive_pf.printed import as_printed
from jaxveh.experiments.model_adaptive_pf.report import Reproduction, check, run, settings, tables
from jaxveh.experiments.model_adaptive_pf.settings import CITATION, Case, Study
from jaxveh.experiments.model_adaptive_pf.study import Raced, drives_of, race

__all__ = [
    "CITATION",
    "CRITERIA",
    "Case",
    "Raced",
    "Reproduction",
    "Study",
    "as_printed",
    "check",
    "drives_of",
    "race",
    "run",
    "settings",
    "tables",
]
