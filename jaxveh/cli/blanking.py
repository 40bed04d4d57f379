"""The part of a log that an estimator may use: it is cut out beforehand, so that no other channel can reach the estimator."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxveh import InputError, Recording
from jaxveh._core.errors import check_positive
from jaxveh._core.names import check_names
from jaxveh._core.recording import gap_to_fill
from jaxveh.cli.several_logs import LACKS
from jaxveh.diagnostics import kit
from jaxveh.estimators import sideslip
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io

READ = tuple(need.channel for need in sideslip.needs)
"""Channels that the estimate reads."""

REAR_ANGLES = ("steer_rear", "steer_rl", "steer_rr")
"""Angles of the rear wheels, which are read for a car whose file says that they are steered."""

SEEN = (*READ, "steer", *REAR_ANGLES)
"""Channels that the estimator may use; only a fit of the front axle uses the steer, and only a car whose file says that its rear
wheels are steered has their angles."""

NEEDED = tuple(need.channel for need in sideslip.needs if not need.optional)
"""Channels without which there is no estimate."""

INPUTS = tuple(need.channel for need in sideslip.needs if need.throughout)
"""Channels that must be finite in every row."""


def read_for(car: CarSpecification) -> tuple[str, ...]:
    """Return the channels that the estimate reads for a car."""
    if car.steers_front_alone:
        return READ
    return (*READ, *REAR_ANGLES, *(("steer",) if car.steering == "four-wheel" else ()))


def fill_gaps(recording: Recording, max_gap: float | None) -> Recording:
    """Fill gaps in the inputs by linear interpolation over at most `max_gap` seconds, if that is given; rows before the first
    sample and after the last one, as slower sensors have them, take the nearest sample that is not further away.

    **Raises** `InputError`, with the option that helps, if a channel of `NEEDED` is missing, or an input is still NaN.
    """
    if max_gap is not None:
        check_positive("--fill", max_gap, "s")
    missing = [name for name in NEEDED if name not in recording]
    if missing:
        likely = io.likely_words(missing, recording.names)
        turns = "v_x" in missing and any(name.startswith("omega_") for name in recording.names)
        wheels = (
            ' A wheel\'s rotation (omega_fl) is mapped as wheel_speed_fl, with scale = the radius and unit = "m/s".'
        )
        raise InputError(
            f"{LACKS}{', '.join(missing)}; it must have {', '.join(NEEDED)}.{' ' if likely else ''}{likely} Map their "
            f"columns with --channels (jaxveh schema channels).{wheels if turns else ''}"
        )
    for name in (*INPUTS, *(name for name in ("steer", *REAR_ANGLES) if name in recording)):
        recording = fill_short(recording, name, max_gap)
        gaps = np.isnan(np.asarray(recording[name]))
        if name in INPUTS and gaps.any():
            if gaps.all():
                raise InputError(
                    f"input channel {name} has no value in any row: map another column with --channels (jaxveh schema channels)."
                )
            first = np.asarray(recording.time)[np.argmax(gaps)]
            needed = gap_to_fill(recording, name)
            option = "add --fill" if max_gap is None else "raise --fill to"
            advice = f"{option} {needed:g} to fill them, or take a --span without the gap"
            raise InputError(
                f"input channel {name} is NaN in {int(gaps.sum())} rows, first at t = {first:g} s: inputs must be finite; "
                f"{advice}."
            )
    return recording


def fill_short(recording: Recording, name: str, reach: float | None) -> Recording:
    """Fill gaps of a channel of at most `reach` seconds: by linear interpolation, and at the ends by the nearest sample.

    Nothing is filled if `reach` is None, or if the channel has no sample.
    """
    if reach is None or not np.isfinite(np.asarray(recording[name])).any():
        return recording
    recording = recording.fill(name, "linear", reach)
    time, values = np.asarray(recording.time), np.array(recording[name])
    first, last = np.flatnonzero(np.isfinite(values))[[0, -1]]
    values[(time < time[first]) & (time >= time[first] - reach)] = values[first]
    values[(time > time[last]) & (time <= time[last] + reach)] = values[last]
    return recording.replace(**{name: values})


def with_fill_option(reason: str) -> str:
    """The reason of a refusal, with the program's option that fills a gap instead of the library's function."""
    return re.sub(r"Fill it with: recording\.fill\([^)]*max_gap=([^)]*)\)\.", r"Fill it with --fill \1.", reason)


class LogParts(NamedTuple):
    """The parts of a log: the `calibration` span (or None), the rows to `estimate`, and as `truth` all channels of those rows."""

    calibration: Recording | None
    estimate: Recording
    truth: Recording


def split(
    recording: Recording, span: tuple[float, float] | None, calibrate_on: Sequence[str] = (), truth: str | None = None
) -> LogParts:
    """Cut a log into the span, with the channels of `SEEN` and `calibrate_on`, and the rows after it, with those of `SEEN` alone.

    The channel named as `truth` is NaN wherever an estimator could see it, except as `calibrate_on` inside the span.

    **Raises** `InputError` for unknown channels, channels to calibrate on without a span, or no rows after the span.
    """
    check_names("--calibrate-on", calibrate_on, recording.names)
    if truth is not None:
        check_names("--truth", [truth], recording.names)
    if calibrate_on and span is None:
        raise InputError(f"--calibrate-on {calibrate_on[0]}: needs a span; add --calibrate START:END.")
    if span is None:
        return LogParts(None, _visible_channels(recording, (), truth), recording)
    time = np.asarray(recording.time)
    if not span[1] <= time[-1]:
        raise InputError(
            f"--calibrate: the span ends at {kit.shown_time(min(span[1], time[-1]))} s and leaves nothing to estimate; "
            f"the log runs from {kit.shown_time(time[0], time[-1])} s."
        )
    rest = recording.between(span[1], np.inf)
    inside = _visible_channels(recording.between(*span), tuple(calibrate_on), None if truth in calibrate_on else truth)
    return LogParts(inside, _visible_channels(rest, (), truth), rest)


def calibration_part(recording: Recording, calibrate_on: Sequence[str]) -> Recording:
    """Return the log with the channels of `SEEN` and of `calibrate_on`."""
    check_names("--calibrate-on", calibrate_on, recording.names)
    return _visible_channels(recording, tuple(calibrate_on), None)


def _visible_channels(recording: Recording, more: tuple[str, ...], truth: str | None) -> Recording:
    kept = recording.select([name for name in recording.names if name in SEEN or name in more])
    if truth is not None and truth in kept and truth not in more:
        return kept.replace(**{truth: np.full(len(kept), np.nan)})
    return kept
