"""The criteria as they were asked, and those that replace or repeat them."""

from __future__ import annotations

from jaxveh.experiments.report import Terms

RUNS = "runs that failed, of all methods in all scenarios"
CELLS = "cells of the review's table that the numbers leave open"
CELLS_FAST = "cells left open where fast transients are judged by the fast part alone"
LOG = "real log: least sideslip RMSE of all causal methods, degrees"
LOG_CROSSED = "real log: sideslip RMSE of the method that the other half chose, degrees"
LOG_SMOOTHED = "real log: sideslip RMSE with hindsight, degrees"

_DRIVES = "methods are told the data sheet's car, speed and steer"
_BOUND = (
    "bound: the library's ready-made estimator on the same rows, whose model was developed while their score was looked at "
    "some 45 times"
)

CRITERIA = {
    RUNS: Terms(_DRIVES),
    CELLS: Terms(
        _DRIVES
        + "; a cell is open if its 95 % interval contains the limit; limits and statistics as set before numbers were seen"
    ),
    CELLS_FAST: Terms(
        _DRIVES + "; the fast part was taken after a first look, in which drift hid the fast transients of the row",
        CELLS,
    ),
    LOG: Terms(
        "calibrated without v_y on the log's first half; the least of all methods by the very rows that score it, so that a lead "
        "proves nothing; open without a log; " + _BOUND
    ),
    LOG_CROSSED: Terms(
        "calibrated likewise; each half of the scored rows chooses, by its v_y, the method that is scored on the other; "
        + _BOUND,
        LOG,
    ),
    LOG_SMOOTHED: Terms("the handling model's smoother: every row from all rows; " + _BOUND, LOG),
}
"""The criteria by name; those that replace or repeat another follow it."""
