"""The criteria of FMVSS 126 for a sine with dwell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, crossing, has, peak, seconds

LIMITS = {1.0: 0.35, 1.75: 0.20}
"""Seconds after the completion of steer, and the share of the peak yaw rate that may be left then (S5.2.1, S5.2.2)."""

DISPLACED_AFTER, DISPLACEMENT = 1.07, 1.83
"""Seconds after the beginning of steer, and the lateral displacement (m) that must be reached then (S5.2.3; cars up to 3500 kg,
from 5 times the steering wheel's angle at 0.3 g on)."""

BEGINNING = math.radians(5.0)
"""Angle of the steering wheel at which the steer begins, rad."""

COMPLETE = 0.01
"""Share of the peak steer below which the steer counts as back at zero: ours."""


class SineWithDwellTest(NamedTuple):
    """What 49 CFR 571.126, S5.2 asks of a sine with dwell. Instants in s of the recording's time, the rest SI.

    `begins`, `completed`: beginning and completion of steer. `peak`, `peak_at`: the yaw rate's first peak after the steer
    changed sign, positive in its direction, and when. `ratio_1_00`, `ratio_1_75`: the yaw rate over that peak 1 and 1.75 s
    after the completion of steer. `displacement`: the lateral way (m) in the direction of the first steer, 1.07 s after its
    beginning. `stable`, `responsive`: whether ratios and displacement are within the limits.
    """

    begins: float
    completed: float
    peak: float
    peak_at: float
    ratio_1_00: float
    ratio_1_75: float
    displacement: float
    stable: bool
    responsive: bool

    @property
    def passed(self) -> bool:
        """Whether the drive is within all limits."""
        return self.stable and self.responsive


def sine_with_dwell(recording: Recording, *, steering_ratio: float = 16.0) -> SineWithDwellTest:
    """The criteria of FMVSS 126 (49 CFR 571.126, S5.2) for a drive whose `steer` is one sine with dwell.

    `steering_ratio`: the steering wheel's angle over `steer`, by which its 5 degrees are known. Lateral displacement is that of
    the position where the recording has one, else the twice integrated lateral acceleration as in S7.11. Nothing is
    filtered here, other than in the standard: filter a noisy log first (`sensors.low_pass`).

    **Raises** `InputError` for missing channels, a steer that is no such sine, or a drive that ends too early.
    """
    check_positive("steering_ratio", steering_ratio)
    time, steer, yaw_rate = seconds(recording), channel(recording, "steer"), channel(recording, "yaw_rate")
    begins, reverses, completed = _instants(time, steer, BEGINNING / steering_ratio)
    if time[-1] < completed + max(LIMITS):
        raise InputError(
            f"sine_with_dwell: the drive ends at {time[-1]:g} s, but is looked at {max(LIMITS):g} s after the completion of "
            f"steer at {completed:.3f} s: drive longer."
        )
    side = np.sign(steer[np.argmax(np.abs(steer) * (time < reverses))])
    turned = -side * yaw_rate
    at, top = _first_peak(time, turned, reverses)
    left = {after: float(np.interp(completed + after, time, turned)) / top for after in LIMITS}
    displacement = side * _displacement(recording, time, begins)
    return SineWithDwellTest(
        begins, completed, top, at, left[1.0], left[1.75], displacement,
        all(left[after] <= limit for after, limit in LIMITS.items()), displacement >= DISPLACEMENT,
    )  # fmt: skip


def _instants(time: np.ndarray, steer: np.ndarray, beginning: float) -> tuple[float, float, float]:
    """When the steer begins, changes sign and is back at zero."""
    size = np.abs(steer)
    begins = crossing(time, size, beginning)
    most = float(np.max(size))
    turned = np.flatnonzero(size > COMPLETE * most)
    if not begins < time[-1] or turned[-1] == size.size - 1:
        raise InputError(
            f"sine_with_dwell: the steer (at most {most:g} rad) does not begin (beyond {beginning:g} rad) and come back to zero."
        )
    first = np.sign(np.interp(begins, time, steer))
    reverses = crossing(time, -first * steer, 0.5 * beginning, begins)
    if not np.isfinite(reverses):
        raise InputError("sine_with_dwell: the steer does not change sign; it is no sine.")
    # The steer crosses the level between this row and the next.
    k = int(turned[-1])
    share = (size[k] - COMPLETE * most) / (size[k] - size[k + 1])
    return begins, reverses, float(time[k] + share * (time[k + 1] - time[k]))


def _first_peak(time: np.ndarray, turned: np.ndarray, after: float) -> tuple[float, float]:
    """Instant and height of the first local maximum after the reversal that is at least half of the greatest value there."""
    inner = (turned[1:-1] >= turned[:-2]) & (turned[1:-1] > turned[2:]) & (time[1:-1] > after)
    tall = turned[1:-1] >= 0.5 * np.max(turned[time > after])
    found = np.flatnonzero(inner & tall & (turned[1:-1] > 0)) + 1
    if found.size == 0:
        raise InputError("sine_with_dwell: the yaw rate has no peak after the steer changed sign.")
    k = int(found[0])
    return peak(time[k - 1 : k + 2], turned[k - 1 : k + 2])


def _displacement(recording: Recording, time: np.ndarray, begins: float) -> float:
    """How far left of the initial straight path the car is, m, in time after the beginning of steer."""
    at = begins + DISPLACED_AFTER
    if has(recording, "x", "y", "yaw"):
        yaw = channel(recording, "yaw")[0]
        left = channel(recording, "y") * math.cos(yaw) - channel(recording, "x") * math.sin(yaw)
        return float(np.interp(at, time, left) - left[0])
    a_y = np.where(time >= begins, channel(recording, "a_y"), 0.0)
    return float(np.interp(at, time, _integral(time, _integral(time, a_y))))


def _integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2)])
