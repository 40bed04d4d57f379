"""The review's circles and crosses, and the claims of its text, as numbers with intervals and verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxveh.experiments.sideslip_review.settings import MARKED, MARKS, Study
from jaxveh.experiments.sideslip_review.study import Raced
from jaxveh.sweeps import ConfidenceInterval, compare

SUPPORTS, CONTRADICTS, OPEN = "supports", "contradicts", "cannot tell"


class Statistic(NamedTuple):
    """The statistic of a row: the median over seeds of `metric` in a `scenario` over `reference`, (metric, scenario).

    If the reference's metric is `of_...`, it is a share of sideslip itself, otherwise the growth of an error. `what`: a
    description.
    """

    metric: str
    scenario: str
    reference: tuple[str, str]
    what: str

    @property
    def is_share(self) -> bool:
        """Whether sideslip itself is the reference."""
        return self.reference[0].startswith("of_")


ROWS = {
    "normal driving": Statistic("early", "normal", ("of_early", "normal"), "error over sideslip, ordinary driving"),
    "hard cornering": Statistic("early", "limit", ("of_early", "limit"), "error over sideslip, at the limit"),
    "robust to sensor bias": Statistic("early", "sensor bias", ("early", "normal"), "error over that without the bias"),
    "stable over a long time": Statistic(
        "late", "normal", ("early", "normal"), "error at the end over the beginning's"
    ),
    "robust to a change of friction": Statistic(
        "late", "friction", ("late", "normal"), "error over that without the change"
    ),
    "robust to vehicle parameters": Statistic(
        "early", "parameters", ("early", "normal"), "error over that of a known car"
    ),
    "shows fast transients": Statistic("fast", "transient", ("of_fast", "transient"), "fast error over fast sideslip"),
}
"""The statistic of each row of the review's table."""

FIRST_ROWS = ROWS | {
    "shows fast transients": Statistic(
        "early", "transient", ("of_early", "transient"), "error over sideslip, fast steering"
    ),
}
"""The statistics as set before any number was seen; the fast part alone for transients was decided after a first look."""

BANK = Statistic("early", "bank", ("early", "normal"), "error over that on a level road")
"""The statistic of the bank, which is not in the table but in the text."""


class Verdict(NamedTuple):
    """One cell: its `row` with its `statistic` and its column (`method`), the review's `mark` (True: circle), the number
    `found` with its interval, its `limit`, the `verdict`."""

    row: str
    statistic: Statistic
    method: str
    mark: bool
    found: ConfidenceInterval
    limit: float
    verdict: str


class Claim(NamedTuple):
    """A sentence of the text: errors `a` over errors `b`, (metric, method, scenario) each, should be between `low` and `high`."""

    text: str
    a: tuple[str, str, str]
    b: tuple[str, str, str]
    low: float
    high: float


DECADE = 10**0.5
"""Errors within this factor, up or down, are of one order of magnitude."""


BETTER = 0.95
"""A ratio of errors above this counts as no improvement: the error must be smaller by a twentieth at least. Decided after a
first table of 20 seeds, in which unscented and particle filters led by a hundredth or two: without this limit their claims
would be supported, or left undecided. The claims are therefore also judged without it."""


def _claim(text: str, scenario: str, a: str, b: str, low: float = 0.0, high: float = BETTER) -> Claim:
    return Claim(text, ("early", a, scenario), ("early", b, scenario), low, high)


CLAIMS = (
    _claim("at the limit nonlinear tyres are better than linear ones", "limit", "EKF", "linear Kalman"),
    _claim("observers of one model and one sensor set are of one order", "limit", "Luenberger", "EKF", 1 / DECADE, DECADE),
    _claim("observers of one model and one sensor set are of one order", "limit", "sliding mode", "EKF", 1 / DECADE, DECADE),
    _claim("UKF is better than EKF in strongly nonlinear cases", "limit", "UKF", "EKF"),
    _claim("PF is better than EKF", "limit", "PF", "EKF"),
    _claim("UPF is the best of UPF, UKF and EKF", "limit", "UPF", "UKF"),
    _claim("UPF is the best of UPF, UKF and EKF", "limit", "UPF", "EKF"),
    _claim("pseudo-integration handles sensor bias better than integration", "sensor bias", "pseudo-integration", "integration"),
    _claim("pseudo-integration handles banks better than integration", "bank", "pseudo-integration", "integration"),
    _claim("pseudo-integration handles model errors better than the model", "parameters", "pseudo-integration", "EKF"),
    Claim(
        "pseudo-integration does not remove the bias of a_y", ("early", "pseudo-integration", "sensor bias"),
        ("early", "pseudo-integration", "normal"), 1.0 / BETTER, float("inf"),
    ),
    _claim("weighted fusion handles sensor bias better than kinematics", "sensor bias", "weighted", "kinematic Kalman"),
    _claim("weighted fusion handles model errors better than the model", "parameters", "weighted", "EKF"),
)  # fmt: skip
"""The text's claims about methods, with ours in place of those that it names."""


def number(raced: Raced, statistic: Statistic, method: str) -> ConfidenceInterval:
    """The statistic of a method with its 95 % bootstrap interval."""
    metric, scenario = statistic.reference
    return compare(raced.at(statistic.metric, method, statistic.scenario), raced.at(metric, method, scenario)).ratio


def limit_of(study: Study, statistic: Statistic) -> float:
    """The largest good value."""
    return study.share_limit if statistic.is_share else study.growth_limit


def judge(found: ConfidenceInterval, low: float, high: float, expected: bool = True) -> str:
    """Whether the number is within the bounds as expected; it cannot be decided if a bound lies inside its interval."""
    if not np.isfinite([found.value, found.low]).all():
        inside = None if np.isnan(found.value) else False
    elif found.low >= low and found.high <= high:
        inside = True
    elif found.low > high or found.high < low:
        inside = False
    else:
        return OPEN
    if inside is None:
        return ""
    return SUPPORTS if inside == expected else CONTRADICTS


def verdicts(raced: Raced, rows: Mapping[str, Statistic] = ROWS) -> list[Verdict]:
    """Every cell of the review's table."""
    found = []
    for row, marks in MARKS.items():
        for method, mark in zip(MARKED, marks, strict=True):
            value, limit = number(raced, rows[row], method), limit_of(raced.study, rows[row])
            found.append(Verdict(row, rows[row], method, mark, value, limit, judge(value, 0.0, limit, mark)))
    return found


class Judged(NamedTuple):
    """A claim with its number, its verdict, and the verdict for any lead at all."""

    claim: Claim
    ratio: ConfidenceInterval
    verdict: str
    by_any_lead: str


def claims(raced: Raced) -> list[Judged]:
    """Every claim of the text, with its number and verdicts."""
    found = []
    for claim in CLAIMS:
        ratio = compare(raced.at(*claim.a), raced.at(*claim.b)).ratio
        low, high = (1.0 if bound in (BETTER, 1.0 / BETTER) else bound for bound in (claim.low, claim.high))
        found.append(Judged(claim, ratio, judge(ratio, claim.low, claim.high), judge(ratio, low, high)))
    return found
