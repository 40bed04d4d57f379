"""Numbers that figures share with the diagnostics that they show, and tools for estimators of real logs."""

from jaxveh.diagnostics.log_delays import a_y_delay
from jaxveh.diagnostics.log_findings import shown_time
from jaxveh.diagnostics.observability import UNOBSERVABLE
from jaxveh.diagnostics.scores import NORMAL_95, NORMAL_HALF
from jaxveh.diagnostics.sine_with_dwell import DISPLACED_AFTER, DISPLACED_FROM, DISPLACEMENT, YAW_RATE_LIMITS
from jaxveh.diagnostics.steady_state import LINEAR_A_Y
from jaxveh.diagnostics.step_response import RESPONSE_SHARE

__all__ = [
    "DISPLACED_AFTER",
    "DISPLACED_FROM",
    "DISPLACEMENT",
    "LINEAR_A_Y",
    "NORMAL_95",
    "NORMAL_HALF",
    "RESPONSE_SHARE",
    "UNOBSERVABLE",
    "YAW_RATE_LIMITS",
    "a_y_delay",
    "shown_time",
]
