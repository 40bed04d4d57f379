"""The frequency response of a car to its steering, from a drive (ISO 7401, random and continuous sinusoidal input)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check, check_positive
from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, check_gaps, seconds

LONGEST = 20.0
"""Longest default segment, s: a resolution of 0.05 Hz."""

EXCITED = 0.01
"""Share of the input's largest spectral density below which a frequency does not count as excited."""


END_ROWS, STILL = 2, 0.05
"""A drive starts and ends straight if this many rows at either end lie within this share of the range."""


class FrequencyResponse(NamedTuple):
    """A frequency response.

    `frequency` (n,) in Hz, where the input has power; `response` (n,) complex, output over input in SI units;
    `coherence` (n,) from 0 to 1: the share of the output that the input explains linearly; `segments`: the number of averaged
    segments (with one, the coherence has no meaning).
    """

    frequency: np.ndarray
    response: np.ndarray
    coherence: np.ndarray
    segments: int


@on_host
def frequency_response(
    recording: Recording, output: str = "yaw_rate", input: str = "steer", *, segment: float | None = None
) -> FrequencyResponse:
    """Return the response of `output` to `input` by Welch's method: mean cross spectrum over mean input spectrum (H1 estimate).

    Segments of `segment` seconds (default: a quarter of the drive, at most `LONGEST`) have Hann windows and overlap by three
    quarters (P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967); J. S. Bendat and A. G. Piersol, Random Data, ch. 11).
    A drive that starts and ends straight is extended by its end values, so that full windows cover the ends of a sweep; in any
    other drive the mean of each segment is subtracted. An uneven time base is made even by linear interpolation. The response is
    biased where it changes within `1 / segment` Hz.

    **Raises** `InputError` for missing channels or gaps in them of more than `LONGEST_GAP` (0.5 s), a constant input,
    or a segment that is out of range.
    """
    time = seconds(recording)
    length = float(time[-1] - time[0])
    segment = float(min(length / 4, LONGEST)) if segment is None else segment
    check_positive("segment", segment, "s")
    check("segment", segment, lambda v: v <= length, f"at most the drive's length, {length:g} s")
    step = float(np.median(np.diff(time))) if time.size > 1 else 1.0
    even = time[0] + step * np.arange(int(length / step + 0.5) + 1)
    for name in (input, output):
        check_gaps(recording, name, time[0], time[-1], "frequency_response")
    u, y = (np.interp(even, time, channel(recording, name)) for name in (input, output))
    rows = min(round(segment / step), even.size)
    if rows < 8:
        raise InputError(f"segment = {segment:g} s: has {rows} rows; there must be at least 8.")
    if all(_straight_ends(values) for values in (u, y)):
        u, y = (np.pad(values - values[0], rows) for values in (u, y))
    U, Y = _spectra(u, rows), _spectra(y, rows)
    S_uu, S_yy = np.mean(np.abs(U) ** 2, axis=0), np.mean(np.abs(Y) ** 2, axis=0)
    S_uy = np.mean(np.conj(U) * Y, axis=0)
    if not np.max(S_uu[1:]) > 0:
        raise InputError(f"frequency_response: {input} is constant; there is no excitation.")
    # The mean is removed, so that frequency zero has no information.
    keep = S_uu >= EXCITED * np.max(S_uu[1:])
    keep[0] = False
    S_uu, S_yy, S_uy = S_uu[keep], S_yy[keep], S_uy[keep]
    explained = np.abs(S_uy) ** 2 / np.where(S_yy > 0, S_uu * S_yy, 1.0)
    return FrequencyResponse(np.fft.rfftfreq(rows, step)[keep], S_uy / S_uu, explained, len(U))


def _straight_ends(values: np.ndarray) -> bool:
    """Whether the first two and the last two rows all have the value of the first."""
    ends = np.concatenate([values[:END_ROWS], values[-END_ROWS:]])
    return bool(np.max(np.abs(ends - values[0])) <= STILL * np.ptp(values))


def _spectra(values: np.ndarray, rows: int) -> np.ndarray:
    """Return the Fourier transforms of the segments, (segments, frequencies)."""
    window = np.hanning(rows + 1)[:-1]
    starts = range(0, values.size - rows + 1, max(rows // 4, 1))
    parts = np.stack([values[start : start + rows] for start in starts])
    if not _straight_ends(values):
        parts = parts - parts.mean(axis=1, keepdims=True)
    return np.fft.rfft(parts * window, axis=1)
