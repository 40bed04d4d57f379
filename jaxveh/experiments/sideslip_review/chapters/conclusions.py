"""The review's four conclusions, put to the test: errors of methods that follow them over those of methods that do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh.experiments.sideslip_review.chapters.race import Raced
from jaxveh.experiments.sideslip_review.chapters.scenarios import SCENARIOS
from jaxveh.experiments.sideslip_review.verdicts import BETTER, judge
from jaxveh.sweeps import ConfidenceInterval, Table, compare

Key = tuple[str, str, str]


class Conclusion(NamedTuple):
    """`text`: what the review concludes. Errors of `follows` over those of `does_not` (quantity, method, shown name) in
    `scenarios` (all where none is named: each seed counts with its geometric mean) should be below `BETTER`."""

    number: int
    text: str
    follows: Key
    does_not: Key
    scenarios: tuple[str, ...] = ()


def ratio(raced: Raced, one: Conclusion) -> ConfidenceInterval:
    """The ratio with its 95 % bootstrap interval over seeds."""
    places = [list(SCENARIOS).index(name) for name in (one.scenarios or tuple(SCENARIOS))]
    error = lambda key: np.exp(np.mean(np.log(np.maximum(raced.found[key]["rmse"][places], 1e-12)), axis=0))
    return compare(error(one.follows), error(one.does_not)).ratio


def conclusion_table(raced: Raced, conclusions: tuple[Conclusion, ...]) -> Table:
    """Each conclusion, the ratio by which it is judged, and the verdict."""
    rows = []
    for one in conclusions:
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
        f"The review's conclusions: errors of one over the other's on the same seeds; better is below {BETTER:g}",
        ("conclusion", "of", "over", "in", "ratio", "verdict"), rows,
    )  # fmt: skip
