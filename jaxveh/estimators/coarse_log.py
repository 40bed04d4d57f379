"""Prepares a log for a calibration: smoothed in both directions, a few rows per second.

The information about a tyre in a real log is slow: below about 1 Hz the accelerometer, the yaw rate and the motion agree on
every car; above it they do not (compliance, vibration, delays of channels). So a calibration uses only the slow part.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jaxveh._core.lengths import common_length
from jaxveh._core.recording import Recording
from jaxveh.estimators.cleaning import without_wild_values
from jaxveh.estimators.rear_axle import CHANNEL, INPUTS, STEERED, USUAL_WHEELBASE, rolling_below
from jaxveh.estimators.rear_steer import CHANNEL as STEER_REAR

CUTOFF = 0.7
"""Hz, for a car of the usual wheelbase: the -3 dB frequency of the smoothing."""

RATE = 3.0
"""Rows per second, for a car of the usual wheelbase: a smooth signal holds no more information."""

LONGEST_GAP = 0.3
"""s: rows further from a measurement are not counted."""

ROWS = 128
"""Logs are filled up with empty rows to a multiple of this, and long ones to a common length, so that one compiled program serves
calibrations of many lengths."""


def coarse_logs(recordings: Sequence[Recording], wheelbase: float) -> list[Recording]:
    """Several logs prepared by `coarse`, all with as many rows as the longest."""
    logs = [coarse(one, wheelbase) for one in recordings]
    longest = max(len(log) for log in logs)
    return [_filled_up(log, longest) for log in logs]


def coarse(recording: Recording, wheelbase: float) -> Recording:
    """The inputs and the balance of `rear_axle_model` from a log with v_x, yaw_rate and a_y, at a few rows per second.

    Integrals over a step are exact: `turning` and `a_y` are means until the next row. The channels of `recording` must be known
    in every row except for gaps (NaN), which are bridged and not counted.
    """
    quick = (USUAL_WHEELBASE / wheelbase) ** 0.5
    recording = without_wild_values(recording, wheelbase)
    time, step = _even(np.asarray(recording.time, float))
    v_x, yaw_rate, a_y = (_bridged(recording, name, time) for name in ("v_x", "yaw_rate", "a_y"))
    a_x = _bridged(recording, "a_x", time) if _known(recording, "a_x") else np.gradient(v_x, time)
    smooth = lambda values: _smoothed(values, step, CUTOFF * quick)
    slow = {"v_x": smooth(v_x), "yaw_rate": smooth(yaw_rate), "a_y": smooth(a_y), "a_x": smooth(a_x)}
    near = _near(recording, time)
    slow["a_y"] = np.where(near, slow["a_y"], slow["v_x"] * slow["yaw_rate"])
    turning = smooth(v_x * yaw_rate)
    stride = max(1, round(1 / (RATE * quick * step)))
    at = np.arange(0, len(time), stride)
    mean = lambda values: np.append(np.diff(_integral(values, step)[at]) / (stride * step), values[at[-1]])
    counted = (slow["v_x"][at] >= rolling_below(wheelbase)) & near[at]
    none = np.zeros(len(at))
    rows = {
        "v_x": slow["v_x"][at], "a_x": slow["a_x"][at], "yaw_rate": slow["yaw_rate"][at], "turning": mean(turning),
        "a_y": mean(slow["a_y"]), "yaw_rate_smooth": slow["yaw_rate"][at],
        "yaw_acceleration": np.gradient(slow["yaw_rate"], time)[at], "a_y_smooth": slow["a_y"][at],
        "a_y_lead": none, "turning_lead": none, "lag": none, "step": none + stride * step, "felt": near[at] + none,
        CHANNEL: np.where(counted, 0.0, np.nan),
    }  # fmt: skip
    if STEER_REAR in recording:
        rows |= dict.fromkeys(STEERED, smooth(_bridged(recording, STEER_REAR, time))[at])
    if "v_y" in recording:
        rows["v_y"] = _reference(recording, time, step, quick)[at]
    return _filled_up(Recording(time[at], rows), common_length(-(-len(at) // ROWS) * ROWS))


def _even(time: np.ndarray) -> tuple[np.ndarray, float]:
    step = float(np.median(np.diff(time)))
    return np.arange(time[0], time[-1], step), step


def _known(recording: Recording, name: str) -> bool:
    return name in recording and bool(np.isfinite(np.asarray(recording[name])).any())


def _bridged(recording: Recording, name: str, time: np.ndarray) -> np.ndarray:
    values = np.asarray(recording[name], float)
    there = np.isfinite(values)
    return np.interp(time, np.asarray(recording.time, float)[there], values[there])


def _smoothed(values: np.ndarray, step: float, cutoff: float) -> np.ndarray:
    """Weighted means over both sides with a bell of -3 dB at `cutoff` (Hz); at the ends, over the values that exist."""
    sigma = np.sqrt(np.log(2) / 2) / (2 * np.pi * cutoff) / step
    reach = int(4 * sigma) + 1
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    whole = np.convolve(np.ones_like(values), bell)[reach : reach + len(values)]
    return np.convolve(values, bell)[reach : reach + len(values)] / whole


def _integral(values: np.ndarray, step: float) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(0.5 * step * (values[1:] + values[:-1]))])


def _near(recording: Recording, time: np.ndarray) -> np.ndarray:
    """Whether yaw rate and a_y were measured within `LONGEST_GAP` of these times."""
    there = np.isfinite(np.asarray(recording["yaw_rate"])) & np.isfinite(np.asarray(recording["a_y"]))
    known = np.asarray(recording.time, float)[there]
    place = np.clip(np.searchsorted(known, time), 1, len(known) - 1)
    return np.minimum(abs(time - known[place - 1]), abs(time - known[place])) <= LONGEST_GAP


def _reference(recording: Recording, time: np.ndarray, step: float, quick: float) -> np.ndarray:
    values = np.asarray(recording["v_y"], float)
    if not np.isfinite(values).any():
        return np.full(len(time), np.nan)
    seen = np.interp(time, np.asarray(recording.time, float), np.where(np.isfinite(values), 1.0, 0.0))
    return np.where(seen > 0.5, _smoothed(_bridged(recording, "v_y", time), step, CUTOFF * quick), np.nan)


def _filled_up(recording: Recording, count: int) -> Recording:
    """The recording filled up with empty rows at its end to `count` rows."""
    extra = count - len(recording)
    time, step = np.asarray(recording.time), float(recording.time[1] - recording.time[0])
    last = {name: np.asarray(recording[name]) for name in recording.names}
    rows = {
        name: np.append(values, np.full(extra, values[-1] if name in INPUTS + STEERED else np.nan))
        for name, values in last.items()
    }
    return Recording(np.append(time, time[-1] + step * np.arange(1, extra + 1)), rows)
