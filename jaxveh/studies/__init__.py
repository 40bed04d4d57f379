"""Studies as files: cars, manoeuvres, sensors, estimators, filters and metrics by name, swept over what varies."""

from jaxveh.studies.estimating import ESTIMATORS, NamedEstimator
from jaxveh.studies.metrics import METRICS, Metric
from jaxveh.studies.named_filters import FILTERS, filter_of
from jaxveh.studies.reading import STUDY_SCHEMA, read_study, study_of
from jaxveh.studies.study import Study

__all__ = [
    "ESTIMATORS",
    "FILTERS",
    "METRICS",
    "STUDY_SCHEMA",
    "Metric",
    "NamedEstimator",
    "Study",
    "filter_of",
    "read_study",
    "study_of",
]
