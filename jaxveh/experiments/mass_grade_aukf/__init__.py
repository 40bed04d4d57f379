"""Mass and road grade at small acceleration, by an adaptive unscented Kalman filter and by better ones."""

from jaxveh.experiments.mass_grade_aukf.criteria import CRITERIA
from jaxveh.experiments.mass_grade_aukf.report import Reproduction, as_printed, check, run, settings, tables
from jaxveh.experiments.mass_grade_aukf.settings import CITATION, Study, car, truck
from jaxveh.experiments.mass_grade_aukf.study import Raced, drives_of, race

__all__ = [
    "CITATION",
    "CRITERIA",
    "Raced",
    "Reproduction",
    "Study",
    "as_printed",
    "car",
    "check",
    "drives_of",
    "race",
    "run",
    "settings",
    "tables",
    "truck",
]
