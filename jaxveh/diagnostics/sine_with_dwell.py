"""The criteria of FMVSS 126 for a sine with dwell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, check_gaps, crossing, has, peak, seconds

YAW_RATE_LIMITS = {1.0: 0.35, 1.75: 0.20}
"""Seconds after the completion of steer, and the largest share of the peak yaw rate at that time (S5.2.1, S5.2.2)."""

DISPLACED_AFTER, DISPLACEMENT = 1.07, 1.83
"""Seconds after the beginning of steer, and the least lateral displacement (m) at that time (S5.2.3; for cars up to a gross
vehicle weight rating of 3500 kg; 1.52 m for heavier ones)."""

DISPLACED_FROM = 5.0
"""Multiple of the steer at 0.3 g at and above which the displacement has a limit (S5.2.3)."""

MEASURED = 0.99
"""Share of a commanded steer that the measured steer must reach to count as equal; our choice."""

TURNING, TURNING_FOR, RATE_OVER = math.radians(75.0), 0.2, 0.1
"""Steering begins when the rate of the steering wheel exceeds the first value (rad/s) for the second (s); the third is the time
over which the rate is averaged (s) (S7.11.4, S7.11.5.1)."""

ZEROING = 1.0
"""Time before that over which the means are the offsets of the sensors, s (S7.11.5.2)."""

BEGINNING = math.radians(5.0)
"""Angle of the steering wheel at which the steer begins, rad."""

COMPLETE = 0.01
"""Share of the peak steer below which the steer counts as back at zero; our choice."""


class SineWithDwellTest(NamedTuple):
    """The results of a sine with dwell by 49 CFR 571.126, S5.2. Instants in s of the recording's time, other values in SI units.

    `begins`, `completed`: beginning and completion of steer. `peak`, `peak_at`: the yaw rate's first peak after the steer
    changed sign, positive in its direction, and its instant. `ratio_1_00`, `ratio_1_75`: the yaw rate over that peak 1 and 1.75 s
    after the completion of steer. `displacement`: the lateral displacement (m) in the direction of the first steer, 1.07 s after
    its beginning. `amplitude`: the largest steer over the steer at 0.3 g (NaN if that is unknown).

    `stable`: whether both ratios are within their limits. `responsive`: whether the displacement reaches its limit; None if it
    has no limit (an `amplitude` below 5), or if it is below the limit and the amplitude is unknown.
    """

    begins: float
    completed: float
    peak: float
    peak_at: float
    ratio_1_00: float
    ratio_1_75: float
    displacement: float
    amplitude: float
    stable: bool
    responsive: bool | None

    @property
    def passed(self) -> bool | None:
        """Whether the drive is within all its limits; None if that is unknown because the `amplitude` is unknown."""
        if not self.stable or self.responsive is False:
            return False
        return None if self.responsive is None and math.isnan(self.amplitude) else True


@on_host
def sine_with_dwell(
    recording: Recording,
    *,
    steering_ratio: float = 16.0,
    steer_at_03g: float | None = None,
    displacement_limit: float = DISPLACEMENT,
) -> SineWithDwellTest:
    """Evaluate the criteria of FMVSS 126 (49 CFR 571.126, S5.2) for a drive whose `steer` is one sine with dwell.

    `steering_ratio`: the steering wheel's angle over `steer`, which gives its angle in degrees. `steer_at_03g` (rad at the road
    wheels): the steer at 0.3 g and 80 km/h, the standard's A over the ratio (S7.6; from a `ramp_steer`): displacement has a
    limit only from 5 A upwards. `displacement_limit` (m): 1.83, or 1.52 for a gross vehicle weight rating of more than 3500 kg.

    Offsets of steer, yaw rate and lateral acceleration are removed as in S7.11.5: they are the means over the second before the
    steering wheel turns faster than 75 degrees per second for 0.2 s, or over the part of that second in the drive. Lateral
    displacement is that of the position if the recording has one, otherwise the twice integrated lateral acceleration as in
    S7.11.9, which is not corrected for roll. Nothing is filtered here; the standard uses filters without phase (S7.11.1 to 3).
    Filter a noisy log first; `sensors.low_pass` is causal and delays the filtered channel: instants are right only if `steer` is
    filtered in the same way. In the standard the car coasts (S7.9); a simulated driver with pedals holds the speed.

    **Raises** `InputError` for missing channels or gaps in them of more than `LONGEST_GAP` (0.5 s), a steer that is not such a
    sine, or a drive that ends too early.
    """
    check_positive("steering_ratio", steering_ratio)
    check_positive("displacement_limit", displacement_limit, "m")
    time, steer = seconds(recording), channel(recording, "steer")
    before = _before(time, steer * steering_ratio)
    steer = steer - np.mean(steer[before])
    yaw_rate = channel(recording, "yaw_rate")
    yaw_rate = yaw_rate - np.mean(yaw_rate[before])
    begins, reverses, completed = _instants(time, steer, BEGINNING / steering_ratio, time[before][-1])
    if time[-1] < completed + max(YAW_RATE_LIMITS):
        raise InputError(
            f"sine_with_dwell: the drive ends at {time[-1]:g} s, but is needed until {max(YAW_RATE_LIMITS):g} s after the "
            f"completion of steer at {completed:.3f} s: drive longer."
        )
    for name in ("steer", "yaw_rate"):
        check_gaps(recording, name, time[before][0], completed + max(YAW_RATE_LIMITS), "sine_with_dwell")
    side = float(np.sign(steer[np.argmax(np.abs(steer) * (time < reverses))]))
    turned = -side * yaw_rate
    at, top = _first_peak(time, turned, reverses)
    left = {after: float(np.interp(completed + after, time, turned)) / top for after in YAW_RATE_LIMITS}
    displacement = side * _displacement(recording, time, before, begins)
    amplitude = _amplitude(float(np.max(np.abs(steer))), steer_at_03g)
    return SineWithDwellTest(
        begins, completed, top, at, left[1.0], left[1.75], displacement, amplitude,
        all(left[after] <= limit for after, limit in YAW_RATE_LIMITS.items()),
        _responsive(displacement >= displacement_limit, amplitude),
    )  # fmt: skip


def _amplitude(most: float, steer_at_03g: float | None) -> float:
    if steer_at_03g is None:
        return float("nan")
    check_positive("steer_at_03g", steer_at_03g, "rad")
    return most / float(steer_at_03g)


def _responsive(reached: bool, amplitude: float) -> bool | None:
    if math.isnan(amplitude):
        return True if reached else None
    return reached if amplitude >= MEASURED * DISPLACED_FROM else None


def _before(time: np.ndarray, wheel: np.ndarray) -> np.ndarray:
    """Whether each row is within the second before the steering wheel (rad) begins to turn."""
    late, early = np.minimum(time + RATE_OVER / 2, time[-1]), np.maximum(time - RATE_OVER / 2, time[0])
    fast = np.abs(np.interp(late, time, wheel) - np.interp(early, time, wheel)) > TURNING * (late - early)
    runs = np.flatnonzero(fast & ~np.concatenate([[False], fast[:-1]]))
    for first in runs:
        slow = np.flatnonzero(~fast[first:])
        if slow.size and time[first + slow[0]] - time[first] > TURNING_FOR:
            return (time >= time[first] - ZEROING) & (time <= time[first])
    raise InputError(
        f"sine_with_dwell: the steering wheel never turns faster than {math.degrees(TURNING):g} deg/s for {TURNING_FOR:g} s; "
        "the steer is not a sine with dwell, or the steering_ratio is not that of the car."
    )


def _instants(time: np.ndarray, steer: np.ndarray, beginning: float, start: float) -> tuple[float, float, float]:
    """Return the instants at which the steer begins after the `start`, changes sign, and is back at zero."""
    size = np.abs(steer)
    begins = crossing(time, size, beginning, start)
    most = float(np.max(size))
    turned = np.flatnonzero(size > COMPLETE * most)
    if not begins < time[-1] or turned[-1] == size.size - 1:
        raise InputError(
            f"sine_with_dwell: the steer (at most {most:g} rad) does not exceed {beginning:g} rad and return to zero."
        )
    first = np.sign(np.interp(begins, time, steer))
    reverses = crossing(time, -first * steer, 0.5 * beginning, begins)
    if not np.isfinite(reverses):
        raise InputError("sine_with_dwell: the steer does not change sign; it is not a sine.")
    # The steer crosses the level between this row and the next.
    k = int(turned[-1])
    share = (size[k] - COMPLETE * most) / (size[k] - size[k + 1])
    return begins, reverses, float(time[k] + share * (time[k + 1] - time[k]))


def _first_peak(time: np.ndarray, turned: np.ndarray, after: float) -> tuple[float, float]:
    """Return instant and height of the first local maximum after the reversal that is at least half of the largest value."""
    inner = (turned[1:-1] >= turned[:-2]) & (turned[1:-1] > turned[2:]) & (time[1:-1] > after)
    tall = turned[1:-1] >= 0.5 * np.max(turned[time > after])
    found = np.flatnonzero(inner & tall & (turned[1:-1] > 0)) + 1
    if found.size == 0:
        raise InputError("sine_with_dwell: the yaw rate has no peak after the steer changed sign.")
    k = int(found[0])
    return peak(time[k - 1 : k + 2], turned[k - 1 : k + 2])


def _displacement(recording: Recording, time: np.ndarray, before: np.ndarray, begins: float) -> float:
    """Return the displacement to the left of the initial straight path, m, `DISPLACED_AFTER` the beginning of steer."""
    at = begins + DISPLACED_AFTER
    used = ("x", "y", "yaw") if has(recording, "x", "y", "yaw") else ("a_y",)
    for name in used:
        check_gaps(recording, name, time[before][0], at, "sine_with_dwell")
    if len(used) > 1:
        yaw = channel(recording, "yaw")[0]
        left = channel(recording, "y") * math.cos(yaw) - channel(recording, "x") * math.sin(yaw)
        return float(np.interp(at, time, left) - left[0])
    a_y = channel(recording, "a_y")
    a_y = np.where(time >= begins, a_y - np.mean(a_y[before]), 0.0)
    return float(np.interp(at, time, _integral(time, _integral(time, a_y))))


def _integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2)])
