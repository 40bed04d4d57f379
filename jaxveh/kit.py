"""Tools for extensions of any subpackage: parameters with unit and range, records, checks and their errors.

The `kit` of a subpackage has the tools for that subpackage (`filters.kit`, `estimators.kit`, ...).
"""

from jaxveh._core.bijectors import AbstractBijector, Interval, Positive, Real
from jaxveh._core.errors import check, check_at_least, check_finite, check_one_of, check_positive, check_whole
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh._core.progress import Progress, silent

__all__ = [
    "AbstractBijector",
    "Interval",
    "Positive",
    "Progress",
    "Real",
    "check",
    "check_at_least",
    "check_finite",
    "check_names",
    "check_one_of",
    "check_parameters",
    "check_positive",
    "check_whole",
    "parameter",
    "positive",
    "record",
    "record_type",
    "silent",
]
