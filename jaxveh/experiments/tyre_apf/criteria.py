"""The terms of the criteria: their assumptions, and who was told what."""

from __future__ import annotations

from jaxveh.experiments.report import Terms
from jaxveh.experiments.tyre_apf.saturated import SWEEP
from jaxveh.experiments.tyre_apf.settings import LEVELS, STEP_STEER

_LANE = (
    "median over the drives; the truth is the filter's own single track, whose mass and inertia it is told, and the sensors' "
    "noise; priors of 10 % about other tyres; process noise by the filters' likelihood on other drives"
)
_BOUND = "the truth is the filter's own car; the information in one drive, for any estimator"
_SWEEP = _LANE + "; steering is linear between rows, only D and B unknown"
_SHARP = (
    _LANE
    + "; 300 particles, multinomial resampling, one process noise for both filters by the sum of their likelihoods"
)
_KNOWS = (
    _LANE
    + "; 300 particles, multinomial resampling; the auxiliary filter looks ahead with the process noise, the paper's to a point; "
    "one process noise for both filters by the sum of their likelihoods, chosen again (`predictive`); introduced after the "
    "paper's filter had missed three criteria"
)
AHEAD = "APF that knows the process noise"
"""The name of that filter in the criteria."""

_PRINTED = "the paper's own rule, which uses the truth: nothing is filtered"

_AXES = ("yaw", "yaw-rate")
WHERE = [f"yaw rate {level.yaw_rate:g} rad/s, a_y {level.a_y:g} m/s^2" for level in LEVELS]
"""The levels of the sensors' noise, as text."""


def _of(name: str) -> list[str]:
    """The criteria of the lane change and of the step steers for one method."""
    curves = [
        f"{name} {axle} force-curve RMSE{what}"
        for axle in ("front", "rear")
        for what in (", % of D", " over the prior's")
    ]
    steps = [
        f"{name} step steer {degrees} degrees, {axis} RMSE {against}"
        for degrees in STEP_STEER
        for axis in _AXES
        for against in ("against the paper's", "over the prior mean's")
    ]
    return curves + steps


def _ahead_of(name: str) -> dict[str, Terms]:
    """The criterion of the paper's filter, followed by that of the one that looks ahead with the process noise."""
    return {name: Terms(_SHARP), name.replace("APF", AHEAD): Terms(_KNOWS, name)}


CRITERIA = {
    **{criterion: Terms(_LANE) for name in ("UKF", "MAP") for criterion in _of(name)},
    "lane change: condition number of eight parameters, above": Terms(_BOUND),
    f"{SWEEP}: D and B not observable, number": Terms(_BOUND),
    **{f"{SWEEP}, D and B: {name}'s largest RMSE over its Cramer-Rao bound": Terms(_SWEEP) for name in ("UKF", "MAP")},
    **{
        name: terms
        for criterion in (
            *(f"{where}: APF over PF, parameter RMSE, paired" for where in WHERE),
            f"{WHERE[0]}: share of seeds that the APF wins",
            f"{WHERE[-1]}: APF over PF, spread of the log-likelihood",
        )
        for name, terms in _ahead_of(criterion).items()
    },
    **{
        f"as printed: a walk that filters nothing, by the paper's final rule, relative error of {name}": Terms(_PRINTED)
        for name in "DBC"
    },
}
"""The criteria by name."""
