"""Sensor offsets from the rows in which a car stands, where the sensors should read zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.rear_axle import USUAL_WHEELBASE

STANDING = 0.1
"""m/s, for a car of the usual wheelbase: below this speed it counts as standing."""

LEAST = 0.5
"""s: the least time at standstill for an estimate of the offsets."""

QUIET = 0.02
"""rad/s: if the yaw rate scatters by more, the car is being carried, or turned by hand."""


class Offsets(NamedTuple):
    """The readings of yaw rate (rad/s) and a_y (m/s^2) at standstill."""

    yaw_rate: float
    a_y: float


def offsets_at_standstill(recordings: Sequence[Recording], wheelbase: float) -> Offsets | None:
    """Medians over the rows in which the car stands, None if there are too few. `wheelbase` in m."""
    floor = STANDING * (wheelbase / USUAL_WHEELBASE) ** 0.5
    rows, seconds = [], 0.0
    for one in recordings:
        v_x, yaw_rate, a_y = (np.asarray(one[name], float) for name in ("v_x", "yaw_rate", "a_y"))
        still = (np.abs(v_x) < floor) & np.isfinite(yaw_rate) & np.isfinite(a_y)
        rows.append(np.stack([yaw_rate[still], a_y[still]], axis=1))
        seconds += still.sum() * float(np.median(np.diff(np.asarray(one.time, float))))
    values = np.concatenate(rows)
    if seconds < LEAST or 1.4826 * np.median(np.abs(values[:, 0] - np.median(values[:, 0]))) > QUIET:
        return None
    return Offsets(*(float(value) for value in np.median(values, axis=0)))
