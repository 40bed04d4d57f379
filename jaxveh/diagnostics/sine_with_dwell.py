"""The criteria of FMVSS 126 for a sine with dwell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, check_gaps, crossing, has, peak, seconds

YAW_RATE_LIMITS = {1.0: 0.35, 1.75: 0.20}
"""Seconds after the completion of steer, and the share of the peak yaw rate that may be left then (S5.2.1, S5.2.2)."""

DISPLACED_AFTER, DISPLACEMENT = 1.07, 1.83
"""Seconds after the beginning of steer, and the lateral displacement (m) that must be reached then (S5.2.3; cars up to a gross
vehicle weight rating of 3500 kg, heavier ones 1.52 m)."""

DISPLACED_FROM = 5.0
"""Multiple of the steer at 0.3 g from which on the displacement has a limit (S5.2.3)."""

MEASURED = 0.99
"""Share of a commanded steer that a measured one must reach to count as it: ours."""

TURNING, TURNING_FOR, RATE_OVER = math.radians(75.0), 0.2, 0.1
"""Rate of the steering wheel (rad/s) beyond which it must be for so many seconds for the steering to have begun, and seconds
over which the rate is averaged (S7.11.4, S7.11.5.1)."""

ZEROING = 1.0
"""Seconds before that whose means are taken as the sensors' offsets (S7.11.5.2)."""

BEGINNING = math.radians(5.0)
"""Angle of the steering wheel at which the steer begins, rad."""

COMPLETE = 0.01
"""Share of the peak steer below which the steer counts as back at zero: ours."""


class SineWithDwellTest(NamedTuple):
    """What 49 CFR 571.126, S5.2 asks of a sine with dwell. Instants in s of the recording's time, the rest SI.

    `begins`, `completed`: beginning and completion of steer. `peak`, `peak_at`: the yaw rate's first peak after the steer
    changed sign, positive in its direction, and when. `ratio_1_00`, `ratio_1_75`: the yaw rate over that peak 1 and 1.75 s
    after the completion of steer. `displacement`: the lateral way (m) in the direction of the first steer, 1.07 s after its
    beginning. `amplitude`: the greatest steer over that at 0.3 g (NaN where this is not known).

    `stable`: whether both ratios are within their limits. `responsive`: whether the displacement is; None where it has no limit
    (an `amplitude` below 5), and where it falls short but the amplitude is not known, so that nobody can say.
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
        """Whether the drive is within all limits that it has; None where nobody can say, for want of the `amplitude`."""
        if not self.stable or self.responsive is False:
            return False
        return None if self.responsive is None and math.isnan(self.amplitude) else True


def sine_with_dwell(
    recording: Recording,
    *,
    steering_ratio: float = 16.0,
    steer_at_03g: float | None = None,
    displacement_limit: float = DISPLACEMENT,
) -> SineWithDwellTest:
    """The criteria of FMVSS 126 (49 CFR 571.126, S5.2) for a drive whose `steer` is one sine with dwell.

    `steering_ratio`: the steering wheel's angle over `steer`, by which its degrees are known. `steer_at_03g` (rad at the road
    wheels): the steer at 0.3 g and 80 km/h, the standard's A over the ratio (S7.6; from a `ramp_steer`): displacement has a
    limit from 5 A on only. `displacement_limit` (m): 1.83, for a gross vehicle weight rating of more than 3500 kg 1.52.

    Steer, yaw rate and lateral acceleration are zeroed as in S7.11.5, by their means over the second before the steering wheel
    turns faster than 75 degrees a second for 0.2 s; of a drive that begins later, over what there is of that second. Lateral
    displacement is that of the position where the recording has one, else the twice integrated lateral acceleration as in
    S7.11.9, which is not corrected for roll. Nothing is filtered here; the standard filters without phase (S7.11.1 to 3). Filter
    a noisy log first; `sensors.low_pass` is causal, and so makes late what it filters: instants are right only where `steer` is
    filtered alike. The standard lets the car coast (S7.9); a simulated driver with pedals holds the speed.

    **Raises** `InputError` for missing channels or gaps in them of more than `LONGEST_GAP` (0.5 s), a steer that is no such sine,
    or a drive that ends too early.
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
            f"sine_with_dwell: the drive ends at {time[-1]:g} s, but is looked at {max(YAW_RATE_LIMITS):g} s after the "
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
    """Whether each row lies within the second before the steering wheel (rad) begins to turn."""
    late, early = np.minimum(time + RATE_OVER / 2, time[-1]), np.maximum(time - RATE_OVER / 2, time[0])
    fast = np.abs(np.interp(late, time, wheel) - np.interp(early, time, wheel)) > TURNING * (late - early)
    runs = np.flatnonzero(fast & ~np.concatenate([[False], fast[:-1]]))
    for first in runs:
        slow = np.flatnonzero(~fast[first:])
        if slow.size and time[first + slow[0]] - time[first] > TURNING_FOR:
            return (time >= time[first] - ZEROING) & (time <= time[first])
    raise InputError(
        f"sine_with_dwell: the steering wheel nowhere turns faster than {math.degrees(TURNING):g} deg/s for {TURNING_FOR:g} s; "
        "the steer is no sine with dwell, or the steering_ratio is not that of the car."
    )


def _instants(time: np.ndarray, steer: np.ndarray, beginning: float, start: float) -> tuple[float, float, float]:
    """When the steer begins after the `start`, changes sign and is back at zero."""
    size = np.abs(steer)
    begins = crossing(time, size, beginning, start)
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


def _displacement(recording: Recording, time: np.ndarray, before: np.ndarray, begins: float) -> float:
    """How far left of the initial straight path the car is, m, in time after the beginning of steer."""
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
