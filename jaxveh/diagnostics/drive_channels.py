"""The channels of a drive as plain arrays without gaps, for the numbers of standards."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import InputError, did_you_mean
from jaxveh._core.recording import TRUTH, Recording, check_recording

LONGEST_GAP = 0.5
"""Longest gap that is bridged for a number of a standard, s; our choice. Satellite navigation at 5 Hz has no longer gaps."""


def has(recording: Recording, *names: str) -> bool:
    """Whether the recording has all of these channels, as truth or measured. Raises `InputError` if it is not of one drive."""
    check_recording("drive", recording)
    return all(TRUTH + name in recording or name in recording for name in names)


def channel(recording: Recording, name: str) -> np.ndarray:
    """Return a channel (T,) in SI units: a simulation's truth if there is one, otherwise the measurements.

    Rows without a sample are interpolated linearly (devices of different rates leave such gaps), however long the gap is, and
    rows before the first and after the last sample have the value of that sample, as figures show them. Numbers are not
    taken from long gaps: see `check_gaps`, `within_gaps`.

    **Raises** `InputError` for a missing channel, or a channel without finite samples.
    """
    if not has(recording, name):
        names = list(dict.fromkeys(one.removeprefix(TRUTH) for one in recording.names))
        guess = did_you_mean([name], names)
        raise InputError(f"recording: no channel {name!r}; there are: {', '.join(names)}.{guess}")
    values = _samples(recording, name)
    known = np.isfinite(values)
    if not known.any():
        raise InputError(f"recording: {name} has no finite sample.")
    if known.all():
        return values
    time = seconds(recording)
    return np.interp(time, time[known], values[known])


def check_gaps(recording: Recording, name: str, start: float, end: float, asked_by: str) -> None:
    """Raise `InputError` if a channel has no sample for longer than `LONGEST_GAP` between `start` and `end` (s, own time)."""
    for before, after in _gaps(recording, name):
        if before < end and after > start:
            ended = "from the beginning" if np.isneginf(before) else f"after {before:.3f} s"
            begins = "until the end" if np.isposinf(after) else f"until {after:.3f} s"
            raise InputError(
                f"{asked_by}: {name} has no sample {ended} {begins}; between {start:.3f} and {end:.3f} s, which the numbers "
                f"need, a gap must be at most {LONGEST_GAP:g} s. Cut the gap off the recording (`recording.between`)."
            )


def within_gaps(recording: Recording, name: str) -> np.ndarray:
    """Whether each row (T,) is in a gap of a channel that is longer than `LONGEST_GAP`."""
    time = seconds(recording)
    rows = np.zeros(time.size, bool)
    for before, after in _gaps(recording, name):
        rows |= (time > before) & (time < after)
    return rows


def _gaps(recording: Recording, name: str) -> list[tuple[float, float]]:
    """Return the times of the last sample before and the first after each gap that is too long (s); infinite if there is none."""
    time = seconds(recording)
    known = time[np.isfinite(_samples(recording, name))]
    too_long = LONGEST_GAP + 1e-6  # Rows half a second apart are within it despite rounding.
    inner = np.flatnonzero(np.diff(known) > too_long)
    gaps = [(float(known[k]), float(known[k + 1])) for k in inner]
    if known.size == 0 or known[0] - time[0] > too_long:
        gaps.insert(0, (-np.inf, float(known[0]) if known.size else np.inf))
    if known.size and time[-1] - known[-1] > too_long:
        gaps.append((float(known[-1]), np.inf))
    return gaps


def _samples(recording: Recording, name: str) -> np.ndarray:
    return np.asarray(recording[TRUTH + name if TRUTH + name in recording else name], np.float64)


def seconds(recording: Recording) -> np.ndarray:
    """Return the recording's own time, s. Raises `InputError` if it is not of one drive."""
    check_recording("drive", recording)
    return np.asarray(recording.time, np.float64)


def sideslip_channels(recording: Recording) -> tuple[str, ...]:
    """Return the channels from which the sideslip is taken: the channel itself, otherwise `v_x` and `v_y`."""
    return ("sideslip",) if has(recording, "sideslip") else ("v_x", "v_y")


def sideslip(recording: Recording) -> np.ndarray:
    """Return the sideslip at the centre of gravity (T,), rad: the channel, otherwise from `v_x` and `v_y`."""
    if has(recording, "sideslip"):
        return channel(recording, "sideslip")
    return np.arctan2(channel(recording, "v_y"), channel(recording, "v_x"))


def crossing(time: np.ndarray, values: np.ndarray, level: float, after: float = -np.inf) -> float:
    """Return the first instant (s) at or after `after` at which `values` rise to the `level`, interpolated; NaN if never."""
    above = np.flatnonzero((values >= level) & (time >= after))
    if above.size == 0:
        return float("nan")
    k = int(above[0])
    if k == 0 or time[k - 1] < after:
        return float(time[k])
    share = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def peak(time: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Return instant (s) and height of the largest value: the top of the parabola through it and its neighbours.

    It is the row itself if a neighbour is missing or not finite: values that do not count are minus infinity.
    """
    k = int(np.argmax(values))
    if k in (0, values.size - 1) or not np.isfinite(values[k - 1 : k + 2]).all():
        return float(time[k]), float(values[k])
    a, b, c = np.polyfit(time[k - 1 : k + 2] - time[k], values[k - 1 : k + 2], 2)
    if a >= 0:
        return float(time[k]), float(values[k])
    at = -b / (2 * a)
    return float(time[k] + at), float(c + b * at / 2)
