"""Diagnoses: whether a log is fit to estimate from, and what a recording can tell about parameters at all."""

from jaxveh.diagnostics.log_check import check_log
from jaxveh.diagnostics.log_findings import SEVERITIES, Finding
from jaxveh.diagnostics.log_plausibility import check_car
from jaxveh.diagnostics.observability import Observability, from_sensitivities

__all__ = ["SEVERITIES", "Finding", "Observability", "check_car", "check_log", "from_sensitivities"]
