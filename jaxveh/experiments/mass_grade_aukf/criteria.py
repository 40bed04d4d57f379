"""The criteria as they were asked, and those that replace or repeat them."""

from __future__ import annotations

from jaxveh.experiments.mass_grade_aukf.contestants import pausing_name
from jaxveh.experiments.mass_grade_aukf.observed import WIDE_KNOT
from jaxveh.experiments.report import Terms

RATE, AIDED, BIASED = "grade rate", "accelerometer", "accelerometer with bias"
"""The contestants of the criteria."""

STILL = ("held speed, no pedals", "pedals 0 m/s^2")
"""Drives without pedal activity: only the pedals that hold the speed, a constant one or the drive's own varying one."""


def final_mass(study: str, estimator: str) -> str:
    """The name of the criterion of the final mass."""
    return f"{study}, {estimator}: final mass error, %"


def settling_criterion(study: str, estimator: str) -> str:
    """The name of the criterion of the time to settle."""
    return f"{study}, {estimator}: within 3 % from then on, s"


UPPER = f"truck, {RATE}: upper quartile of the final mass error, %"
GRADE = f"truck, {RATE}: grade RMSE, degrees"


def bound_criterion(drive: str) -> str:
    """The name of the criterion of the bound of three states."""
    return f"three states, {drive}: bound of the mass over its prior's spread"


def error_criterion(drive: str) -> str:
    """The name of the criterion of the error of three states."""
    return f"three states, {drive}: error of the mass over what the prior knew"


_SEEDS = "median over the drives, worst first guess; "
_TOLD = "told the exact torque at the wheels, air and rolling resistance, and the noise of the sensors"
_TRUCK = Terms(_SEEDS + _TOLD)
_PAUSE = Terms(_SEEDS + _TOLD + "; pauses while the brake is touched, as was asked")
_UNKNOWN = (
    _SEEDS
    + _TOLD
    + "; a touched brake is an unknown force: introduced after the pause had missed the first bound on these drives"
)
_BOUND = Terms(
    f"Cramer-Rao bound of one drive, the grade linear over {WIDE_KNOT:g} s: the quantity that was chosen first to show it"
)
_ERROR = "pull of the grade's prior and noise at one drive's own grade, linear problem: chosen after the bound did not show it"

CRITERIA = {
    final_mass("truck", RATE): _TRUCK,
    UPPER: _TRUCK,
    GRADE: _TRUCK,
    settling_criterion("truck", RATE): _TRUCK,
    final_mass("truck", AIDED): _TRUCK,
    settling_criterion("truck", AIDED): _TRUCK,
    **{
        name: terms
        for one in (RATE, AIDED)
        for name, terms in (
            (final_mass("car", pausing_name(one)), _PAUSE),
            (final_mass("car", one), Terms(_UNKNOWN, final_mass("car", pausing_name(one)))),
        )
    },
    **{
        name: terms
        for drive in STILL
        for name, terms in (
            (bound_criterion(drive), _BOUND),
            (error_criterion(drive), Terms(_ERROR, bound_criterion(drive))),
        )
    },
}
"""The criteria by name; those that replace or repeat another follow it."""
