"""Studies as files: cars, manoeuvres, sensors, estimators, filters and metrics by name, swept over the varied settings.

`figures` is imported on first use: it needs matplotlib, the extra `plot`.
"""

from typing import TYPE_CHECKING

from jaxveh._core.lazy import submodules
from jaxveh.studies.estimating import ESTIMATORS, NamedEstimator
from jaxveh.studies.metrics import METRICS, Metric
from jaxveh.studies.named_filters import FILTERS, filter_of, filter_options
from jaxveh.studies.reading import STUDY_SCHEMA, read_study, study_of
from jaxveh.studies.study import Study
from jaxveh.studies.tables import tables

if TYPE_CHECKING:
    from jaxveh.studies import figures

__getattr__ = submodules("jaxveh.studies", ("figures",))

__all__ = [
    "ESTIMATORS",
    "FILTERS",
    "METRICS",
    "STUDY_SCHEMA",
    "Metric",
    "NamedEstimator",
    "Study",
    "figures",
    "filter_of",
    "filter_options",
    "read_study",
    "study_of",
    "tables",
]
