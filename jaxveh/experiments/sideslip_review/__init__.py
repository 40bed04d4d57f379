"""Chen, Gao & Xu (2013), a review of sideslip estimation: its circles and crosses as numbers."""

from jaxveh.experiments.sideslip_review.criteria import CRITERIA
from jaxveh.experiments.sideslip_review.report import Reproduction, as_printed, check, run, settings, tables
from jaxveh.experiments.sideslip_review.settings import CITATION, Study
from jaxveh.experiments.sideslip_review.study import Raced, drives_of, race

__all__ = [
    "CITATION", "CRITERIA", "Raced", "Reproduction", "Study",
    "as_printed", "check", "drives_of", "race", "run", "settings", "tables",
]  # fmt: skip
