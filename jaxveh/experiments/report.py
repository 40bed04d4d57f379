"""The report of every experiment: tables to print, and criteria that are met, failed or open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.sweeps import ConfidenceInterval

MET, FAILED, OPEN = "met", "failed", "open"
"""The outcomes of a criterion: it is met, it is not met, or the result cannot decide."""

BETTER = 0.95
"""A ratio of errors above this counts as no improvement: the error must be smaller by a twentieth at least."""


class Terms(NamedTuple):
    """The terms of a criterion, written down before anything runs.

    `condition`: the assumptions, and who was told what. `original`: empty for a criterion as it was asked; otherwise the
    name of the criterion as asked that this one replaces, or repeats under another condition.
    """

    condition: str
    original: str = ""


Criteria = Mapping[str, Terms]
"""An experiment's criteria by name; those with an `original` follow it."""


class Check(NamedTuple):
    """One criterion: the value found, the bound, `status` (met, failed or open), and its `Terms`."""

    name: str
    value: float
    bound: float
    status: str
    condition: str = ""
    original: str = ""

    @property
    def holds(self) -> bool:
        """Whether it is met; an open criterion is not."""
        return self.status == MET


class Tally(NamedTuple):
    """The numbers of criteria as they were asked: `met`, `failed` and `open`, and all `of` them."""

    met: int
    failed: int
    open: int

    @property
    def of(self) -> int:
        """The number of all."""
        return self.met + self.failed + self.open

    def __str__(self) -> str:
        rest = [f"{count} {what}" for what, count in ((FAILED, self.failed), (OPEN, self.open)) if count]
        return f"{self.met} of {self.of}" + (f" ({', '.join(rest)})" if rest else "")


def at_most(name: str, value, bound: float) -> Check:
    """A criterion that holds at or below the bound; it does not hold for NaN."""
    return _make_check(name, value, bound, value <= bound)


def above(name: str, value, bound: float) -> Check:
    """A criterion that holds above the bound."""
    return _make_check(name, value, bound, value > bound)


def at_least(name: str, value, bound: float) -> Check:
    """A criterion that holds at or above the bound."""
    return _make_check(name, value, bound, value >= bound)


def leave_open(check: Check) -> Check:
    """The criterion left open, whatever its number: for a `check` whose result cannot decide."""
    return check._replace(status=OPEN)


def _make_check(name: str, value, bound: float, holds) -> Check:
    return Check(name, float(value), float(bound), MET if holds else FAILED)


def with_terms(checks: Iterable[Check], criteria: Criteria) -> list[Check]:
    """The checks with their terms, in the order of the criteria, so that one that replaces another follows it.

    **Raises** `InputError` if checks and criteria differ: none may be left out, and none may come without its terms.
    """
    found = {check.name: check for check in checks}
    if set(found) != set(criteria):
        raise InputError(
            f"checks without terms: {sorted(set(found) - set(criteria))}; criteria that were not checked: "
            f"{sorted(set(criteria) - set(found))}."
        )
    return [found[name]._replace(**terms._asdict()) for name, terms in criteria.items()]


def tally(checks: Iterable[Check]) -> Tally:
    """The count of the criteria as they were asked; those that replace or repeat them are shown, but not counted."""
    asked = [check.status for check in checks if not check.original]
    return Tally(*(asked.count(status) for status in (MET, FAILED, OPEN)))


def number_asked(criteria: Criteria) -> int:
    """The number of criteria as they were asked."""
    return sum(not terms.original for terms in criteria.values())


def judge_ratio(found: ConfidenceInterval, low: float = 0.0, high: float = BETTER) -> str:
    """Whether a ratio is within bounds: met or failed if its interval is inside or outside of them, otherwise open."""
    if not np.isfinite(found.value) or found.low > high or found.high < low:
        return FAILED
    return MET if found.low >= low and found.high <= high else OPEN


def interval(found: ConfidenceInterval, digits: int = 3) -> str:
    """`value [low, high]` of a number with its bootstrap interval."""
    value, low, high = (float(number) for number in found)
    return f"{value:.{digits}g} [{low:.{digits}g}, {high:.{digits}g}]"


def spread(values, digits: int = 3, scale: float = 1.0, lost: str = "lost") -> str:
    """`median [lower quartile, upper quartile]` of the values; those that are not finite count as the largest and are
    `lost`."""
    values = scale * np.asarray(values, float)
    low, mid, high = np.percentile(np.where(np.isnan(values), np.inf, values), [25, 50, 75], method="nearest")
    shown = lambda v: lost if np.isinf(v) else f"{v:.{digits}g}"
    return f"{shown(mid)} [{shown(low)}, {shown(high)}]"
