"""Tests of the review's four conclusions: errors of methods that follow them over those of methods that do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh.experiments.sideslip_review.chapters.racing import ChaptersRaced
from jaxveh.experiments.sideslip_review.chapters.scenarios import SCENARIOS
from jaxveh.experiments.sideslip_review.verdicts import BETTER, judge
from jaxveh.sweeps import ConfidenceInterval, Table, compare

Key = tuple[str, str, str]


class Conclusion(NamedTuple):
    """`text`: the review's conclusion. The errors of `follows` over those of `does_not` (quantity, method, shown name) in
    `scenarios` (all if none is named: each seed counts with its geometric mean) should be below `BETTER`."""

    number: int
    text: str
    follows: Key
    does_not: Key
    scenarios: tuple[str, ...] = ()


def _of_sideslip(number: int, text: str, follows: str, does_not: str, *scenarios: str) -> Conclusion:
    return Conclusion(number, text, ("sideslip", follows, "sideslip"), ("sideslip", does_not, "sideslip"), scenarios)


TORQUE, PARTS = "the motors' torques improve sideslip", "speed, lateral velocity and parameters each have their method"
FUSION, ADAPTING = "fusion of several methods is better than each", "adapting parameters is an effective means"

CONCLUSIONS = (
    _of_sideslip(1, TORQUE, "motor_moment", "linear_kalman"),
    _of_sideslip(1, TORQUE, "motor_moment", "linear_kalman", "split mu"),
    Conclusion(1, "the motors' torques improve speed", ("speed", "motor_force", "v_x"), ("speed", "weighted", "v_x")),
    Conclusion(2, PARTS, ("speed", "slip_aware", "v_x"), ("speed", "combined", "v_x")),
    _of_sideslip(3, FUSION, "weighted", "kinematic_kalman"),
    _of_sideslip(3, FUSION, "weighted", "ekf"),
    _of_sideslip(3, FUSION, "pseudo_integration", "integration"),
    _of_sideslip(3, FUSION, "pseudo_integration", "ekf"),
    _of_sideslip(3, FUSION, "switched", "ekf"),
    _of_sideslip(4, ADAPTING, "adapted_stiffness", "linear_kalman"),
    _of_sideslip(4, ADAPTING, "adapted_stiffness", "linear_kalman", "wrong stiffness", "heavy load"),
    _of_sideslip(4, ADAPTING, "adapted_stiffness", "linear_kalman", "low mu", "mu jump"),
    Conclusion(
        4,
        ADAPTING + " (with satellites)",
        ("navigation", "adapted_stiffness", "sideslip"),
        ("sideslip", "linear_kalman", "sideslip"),
    ),
)
"""The four conclusions (section 4), by the methods that we have for them. The second one divides the task; the question is
its use: whether an estimated speed is better than one read off the wheels."""


def ratio(raced: ChaptersRaced, one: Conclusion) -> ConfidenceInterval:
    """The ratio with its 95 % bootstrap interval over seeds."""
    places = [list(SCENARIOS).index(name) for name in (one.scenarios or tuple(SCENARIOS))]
    error = lambda key: np.exp(np.mean(np.log(np.maximum(raced.found[key]["rmse"][places], 1e-12)), axis=0))
    return compare(error(one.follows), error(one.does_not)).ratio


def conclusion_table(raced: ChaptersRaced) -> Table:
    """Each conclusion, the ratio by which it is judged, and the verdict."""
    rows = []
    for one in CONCLUSIONS:
        lacking = [key for key in (one.follows, one.does_not) if key not in raced.found]
        if lacking:
            rows.append(
                (
                    f"({one.number}) {one.text}",
                    *[f"{k[1]} ({k[2]})" for k in (one.follows, one.does_not)],
                    "",
                    "",
                    "not raced",
                )
            )
            continue
        found = ratio(raced, one)
        cell = f"{found.value:.2f} [{found.low:.2f}, {found.high:.2f}]"
        words = lambda key: f"{key[1]} ({key[2]})"
        where = ", ".join(one.scenarios) or "all"
        rows.append(
            (
                f"({one.number}) {one.text}",
                words(one.follows),
                words(one.does_not),
                where,
                cell,
                judge(found, 0.0, BETTER),
            )
        )
    return Table(
        f"The review's conclusions: errors of one method over the other's on the same seeds; better is below {BETTER:g}",
        ("conclusion", "of", "over", "in", "ratio", "verdict"), rows,
    )  # fmt: skip
