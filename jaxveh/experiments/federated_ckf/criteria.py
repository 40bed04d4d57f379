"""The criteria as they were asked, and those that replace or repeat them."""

from __future__ import annotations

from jaxveh.experiments.federated_ckf.settings import PARAMETERS
from jaxveh.experiments.report import Terms

SHORT = {"friction": "mu", "mass": "m", "yaw_inertia": "I_z", "front_axle_to_cg": "a"}

STARTS = ("printed start", "nearer start")
"""The cases of the criteria."""

OTHER = "other tyres"
"""The case in which the truth's tyre is not the filter's, from the nearer start."""

ISOLATION = "fault: sideslip RMSE with isolation over that without"
GATE = "fault: sideslip RMSE of the gated joint filter over its fault-free one"
SMALL_STEER = "smallest steer: bound of mu over its prior's spread"


def final(case: str, parameter: str) -> str:
    """The name of the criterion of a final error."""
    return f"joint, {case}: final error of {SHORT[parameter]}, %"


def consistent(who: str, case: str) -> tuple[str, str]:
    """The names of the criteria of the NEES, from below and from above."""
    name = f"{who}, {case}: NEES of the parameters over their number"
    return f"{name}, above", name


def sideslip(case: str) -> str:
    """The name of the criterion of the redesigned filter's sideslip."""
    return f"redesigned, {case}: sideslip RMSE over the joint filter's"


_OWN = (
    "medians over the drives; the filter has the truth's own tyre law and its numbers (Dugoff), and is told steer, motor "
    "torques, air and rolling resistance and the sensors' noise; the prior's standard deviation of log mu was set to 0.8 after "
    "one drive in 40 was lost with 1.0; with 1.0 all of these were met, too"
)
_OTHER = (
    "the same with a Magic Formula of equal stiffness and peak friction as the truth's tyre and Dugoff's law in the filter; "
    "process noise by likelihood on other drives of such a truth"
)


def _of(case: str) -> dict[str, Terms]:
    """The criteria of one start; those of the nearer one are followed by those with other tyres."""
    found = {}
    for name, other in zip(_names("joint", case), _names("joint", OTHER), strict=True):
        found[name] = Terms(_OWN)
        if case == STARTS[1]:
            found[other] = Terms(_OTHER, name)
    return found


def _names(who: str, case: str) -> tuple[str, ...]:
    return (*(final(case, parameter) for parameter in PARAMETERS), *consistent(who, case))


CRITERIA = {
    **{name: terms for case in STARTS for name, terms in _of(case).items()},
    **{name: Terms(_OWN) for case in STARTS for name in (sideslip(case), *consistent("redesigned", case))},
    ISOLATION: Terms(_OWN),
    GATE: Terms(_OWN),
    SMALL_STEER: Terms("Cramer-Rao bound of the first drive with 3 degrees, tyres and rolling resistance known"),
}
"""The criteria by name; those that replace or repeat another follow it."""
