"""What every experiment reports: tables for people, and criteria that hold or do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh.sweeps import Interval


class Check(NamedTuple):
    """One criterion: what was found, the bound, and whether it holds (at or below the bound unless the name says)."""

    name: str
    value: float
    bound: float
    holds: bool


class Table(NamedTuple):
    """A table for people: a title that says what the numbers are, column heads, rows of cells."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple]


def at_most(name: str, value, bound: float) -> Check:
    """A criterion that holds at or below the bound; what is not a number does not hold."""
    return Check(name, float(value), float(bound), bool(value <= bound))


def above(name: str, value, bound: float) -> Check:
    """A criterion that holds above the bound."""
    return Check(name, float(value), float(bound), bool(value > bound))


def at_least(name: str, value, bound: float) -> Check:
    """A criterion that holds at or above the bound."""
    return Check(name, float(value), float(bound), bool(value >= bound))


def interval(found: Interval, digits: int = 3) -> str:
    """`value [low, high]` of a number with its bootstrap interval."""
    value, low, high = (float(number) for number in found)
    return f"{value:.{digits}g} [{low:.{digits}g}, {high:.{digits}g}]"


def spread(values, digits: int = 3, scale: float = 1.0, lost: str = "lost") -> str:
    """`median [lower quartile, upper quartile]` of the values; those that are not finite count as the largest, and are `lost`."""
    values = scale * np.asarray(values, float)
    low, mid, high = np.percentile(np.where(np.isnan(values), np.inf, values), [25, 50, 75], method="nearest")
    shown = lambda v: lost if np.isinf(v) else f"{v:.{digits}g}"
    return f"{shown(mid)} [{shown(low)}, {shown(high)}]"
