"""The parts for adding a filter, an observer or a driver."""

from jaxveh._core.parameter import UNNAMED
from jaxveh.statespace.capabilities import (
    check_covariance,
    check_gradients,
    check_noise_by_row,
    check_rows_between,
    check_smooths,
    gradients_of,
    smoothing_of,
    who_lacks,
)
from jaxveh.statespace.common_length import of_common_length
from jaxveh.statespace.contract import KEPT, check_told, innermost, key_for, layers
from jaxveh.statespace.dependent_noise import check_fixed
from jaxveh.statespace.disturbances import DISTURBANCE_PREFIX
from jaxveh.statespace.draw import draw_rows, schedule_rows
from jaxveh.statespace.driver import (
    SHOWN,
    Steps,
    any_run_misses,
    estimate_of,
    estimate_of_row,
    in_form_for_batches,
    raise_failure,
    run_by,
    scan_and_keep,
    scan_by,
    scan_in_form,
)
from jaxveh.statespace.given_rows import scalar_row
from jaxveh.statespace.independent import whiten
from jaxveh.statespace.measurements import by_channel, input_result, likelihood_result, presence, result_of_parts
from jaxveh.statespace.model import check_model
from jaxveh.statespace.noise import LOG_2PI
from jaxveh.statespace.solvers import EXPLICIT, in_both_modes

__all__ = [
    "DISTURBANCE_PREFIX",
    "EXPLICIT",
    "KEPT",
    "LOG_2PI",
    "SHOWN",
    "UNNAMED",
    "Steps",
    "any_run_misses",
    "by_channel",
    "check_covariance",
    "check_fixed",
    "check_gradients",
    "check_model",
    "check_noise_by_row",
    "check_rows_between",
    "check_smooths",
    "check_told",
    "draw_rows",
    "estimate_of",
    "estimate_of_row",
    "gradients_of",
    "in_both_modes",
    "in_form_for_batches",
    "innermost",
    "input_result",
    "key_for",
    "layers",
    "likelihood_result",
    "of_common_length",
    "presence",
    "raise_failure",
    "result_of_parts",
    "run_by",
    "scalar_row",
    "scan_and_keep",
    "scan_by",
    "scan_in_form",
    "schedule_rows",
    "smoothing_of",
    "whiten",
    "who_lacks",
]
