"""The signs of rig data: slopes with the opposite sign to every tyre's reveal a wrong declaration of the axes.

In this package's axes (z up) a positive slip angle gives a positive F_y, and a positive slip ratio a positive F_x. The force
of a slip angle acts behind the contact's centre, so M_z falls with it. A wheel is pushed to the side to which its top leans:
camber, about x forwards, is positive to the right, where F_y is negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import check_kind
from jaxveh.fitting.rig_stages import LEAST_SPREAD
from jaxveh.io import RigTable

SMALL = {"slip_angle": np.radians(2.0), "slip_ratio": 0.02}
"""Slips below which forces follow slip and camber, to the precision of a sign."""

LEAST_ROWS, LEAST_LOAD = 8, 0.2
"""The least number of rows for a sign, and the share of the median load below which a row is not counted."""

SURE = 3.0
"""The number of standard errors by which a slope must have the wrong sign."""

LEAST_SLOPE = {"F_y, slip_angle": 1.0, "F_x, slip_ratio": 1.0, "M_z, slip_angle": 0.02, "F_y, camber": 0.1}
"""Slopes over load (1/rad, per slip ratio; m/rad for M_z) below which a wrong sign is not reported: an ordinary tyre's are 15,
15, -0.5 and -1."""

EXPECTED = {"F_y, slip_angle": 1.0, "F_x, slip_ratio": 1.0, "M_z, slip_angle": -1.0, "F_y, camber": -1.0}
"""The required sign of each slope."""

WORDS = {
    "F_y, slip_angle": "F_y falls with slip_angle: a positive slip angle must give a positive force",
    "F_x, slip_ratio": "F_x falls with slip_ratio: a positive slip ratio must give a positive force",
    "M_z, slip_angle": "M_z rises with slip_angle: a positive slip angle's force acts behind the centre and turns the wheel back",
    "F_y, camber": "F_y rises with camber: a wheel is pushed to the side that it leans to, for a positive camber to the right",
}


class WrongSign(NamedTuple):
    """A slope of the wrong sign: its `pair` of force and input (`F_y, camber`), the `slope` over load with its standard
    `error`, and a description in `words`."""

    pair: str
    slope: float
    error: float
    words: str


def wrong_signs(rig: RigTable) -> tuple[WrongSign, ...]:
    """The slopes of a rig table that no tyre has, as in data whose axes were declared wrongly."""
    check_kind("rig", rig, RigTable, "io.read_rig_table reads one.")
    found = []
    for pair, sign in EXPECTED.items():
        channel, name = pair.split(", ")
        slope, error = slope_of(rig, channel, name)
        if -sign * slope > max(SURE * error, LEAST_SLOPE[pair]):
            found.append(WrongSign(pair, slope, error, _in_words(rig, pair, slope, error)))
    return tuple(found)


def _in_words(rig: RigTable, pair: str, slope: float, error: float) -> str:
    return (
        f"{rig.source}: {WORDS[pair]} (slope over load {slope:.3g}, standard error {error:.1g}): do the data have the axes that "
        "were given (--axes sae, adapted-sae, iso-w or ours)?"
    )


def slope_of(rig: RigTable, channel: str, name: str) -> tuple[float, float]:
    """The slope over load of a force or moment against slip angle, slip ratio or camber, where slips are small, and its
    standard error.

    Least squares with an offset and, for lateral forces and moments, slip angle and camber together; where few rows have a
    small slip, the smallest ones are used. Slips that a rig holds at steps (0, 2 and 5 degrees) may be twice as large. nan where
    the data do not determine it.
    """
    values = getattr(rig, channel)
    inputs = ["slip_ratio"] if name == "slip_ratio" else ["slip_angle", "camber"]
    varied = [one for one in inputs if _varies(rig, one)]
    if values is None or name not in varied:
        return np.nan, np.nan
    rows = np.isfinite(values) & (rig.load > LEAST_LOAD * np.median(rig.load))
    for slip, most in SMALL.items():
        size = np.abs(getattr(rig, slip))
        if slip in varied and rows.sum() >= LEAST_ROWS:
            most = max(most, float(np.sort(size[rows])[LEAST_ROWS - 1]))
        # About one step, the slip is that step and noise, of which no force is the consequence.
        steps = slip == name and not _varies(rig, slip, rows & (size <= most), tail=10)
        rows &= size <= most * (1.0 + steps)
    if not _varies(rig, name, rows):
        return np.nan, np.nan
    columns = np.stack([getattr(rig, one)[rows] for one in varied] + [np.ones(rows.sum())], axis=1)
    if rows.sum() < LEAST_ROWS or np.linalg.matrix_rank(columns) < columns.shape[1]:
        return np.nan, np.nan
    target = values[rows] / rig.load[rows]
    solution = np.linalg.lstsq(columns, target, rcond=None)[0]
    left = target - columns @ solution
    noise = np.sum(left**2) / max(rows.sum() - columns.shape[1], 1)
    at = varied.index(name)
    return float(solution[at]), float(np.sqrt(noise * np.linalg.inv(columns.T @ columns)[at, at]))


def _varies(rig: RigTable, name: str, rows: np.ndarray | slice = slice(None), tail: float = 2.0) -> bool:
    """Whether an input varies among these rows, without `tail` per cent of them at either end."""
    values = getattr(rig, name)
    if values is None or values[rows].size == 0:
        return False
    return bool(np.ptp(np.percentile(values[rows], [tail, 100.0 - tail])) > LEAST_SPREAD[name])
