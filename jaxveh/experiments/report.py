"""What every experiment reports: tables for people, and criteria that hold, fail or stay open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.sweeps import ConfidenceInterval

MET, FAILED, OPEN = "met", "failed", "open"
"""What becomes of a criterion: it is met, it is not, or what was found cannot decide."""

BETTER = 0.95
"""An error that is smaller by less than a twentieth is no smaller error."""


class Terms(NamedTuple):
    """What a criterion rests on, written down before anything runs.

    `condition`: what is assumed, and who was told what. `original`: empty for a criterion as it was asked; else the name of the
    one as asked that this one stands beside, since it took its place or asks the same under another condition.
    """

    condition: str
    original: str = ""


Criteria = Mapping[str, Terms]
"""An experiment's criteria by name; those with an `original` follow it."""


class Check(NamedTuple):
    """One criterion: what was found, the bound, `status` (met, failed or open), and its `Terms`."""

    name: str
    value: float
    bound: float
    status: str
    condition: str = ""
    original: str = ""

    @property
    def holds(self) -> bool:
        """Whether it is met; what is open is not."""
        return self.status == MET


class Tally(NamedTuple):
    """How many criteria, as they were asked, there are, `of`, and how many are `met`, `failed` and `open`."""

    met: int
    failed: int
    open: int

    @property
    def of(self) -> int:
        """All of them."""
        return self.met + self.failed + self.open

    def __str__(self) -> str:
        rest = [f"{count} {what}" for what, count in ((FAILED, self.failed), (OPEN, self.open)) if count]
        return f"{self.met} of {self.of}" + (f" ({', '.join(rest)})" if rest else "")


def at_most(name: str, value, bound: float) -> Check:
    """A criterion that holds at or below the bound; what is not a number does not hold."""
    return _make_check(name, value, bound, value <= bound)


def above(name: str, value, bound: float) -> Check:
    """A criterion that holds above the bound."""
    return _make_check(name, value, bound, value > bound)


def at_least(name: str, value, bound: float) -> Check:
    """A criterion that holds at or above the bound."""
    return _make_check(name, value, bound, value >= bound)


def leave_open(check: Check) -> Check:
    """The criterion left open, whatever its number says: `check` for what cannot decide."""
    return check._replace(status=OPEN)


def _make_check(name: str, value, bound: float, holds) -> Check:
    return Check(name, float(value), float(bound), MET if holds else FAILED)


def with_terms(checks: Iterable[Check], criteria: Criteria) -> list[Check]:
    """The checks with their terms, in the criteria's order, so that what took the place of another stands behind it.

    **Raises** `InputError` where checks and criteria are not the same: none is left out, and none comes without its terms.
    """
    found = {check.name: check for check in checks}
    if set(found) != set(criteria):
        raise InputError(
            f"checks without terms: {sorted(set(found) - set(criteria))}; criteria that were not looked at: "
            f"{sorted(set(criteria) - set(found))}."
        )
    return [found[name]._replace(**terms._asdict()) for name, terms in criteria.items()]


def tally(checks: Iterable[Check]) -> Tally:
    """The count of the criteria as they were asked: those that stand beside them are shown, and not counted."""
    asked = [check.status for check in checks if not check.original]
    return Tally(*(asked.count(status) for status in (MET, FAILED, OPEN)))


def number_asked(criteria: Criteria) -> int:
    """How many criteria there are as they were asked."""
    return sum(not terms.original for terms in criteria.values())


def judge_ratio(found: ConfidenceInterval, low: float = 0.0, high: float = BETTER) -> str:
    """Whether a ratio is within bounds: met or failed where its interval is inside or outside of them, else open."""
    if not np.isfinite(found.value) or found.low > high or found.high < low:
        return FAILED
    return MET if found.low >= low and found.high <= high else OPEN


def interval(found: ConfidenceInterval, digits: int = 3) -> str:
    """`value [low, high]` of a number with its bootstrap interval."""
    value, low, high = (float(number) for number in found)
    return f"{value:.{digits}g} [{low:.{digits}g}, {high:.{digits}g}]"


def spread(values, digits: int = 3, scale: float = 1.0, lost: str = "lost") -> str:
    """`median [lower quartile, upper quartile]` of the values; those that are not finite count as the largest, and are `lost`."""
    values = scale * np.asarray(values, float)
    low, mid, high = np.percentile(np.where(np.isnan(values), np.inf, values), [25, 50, 75], method="nearest")
    shown = lambda v: lost if np.isinf(v) else f"{v:.{digits}g}"
    return f"{shown(mid)} [{shown(low)}, {shown(high)}]"
