"""Checks of the sampling of a log: rates, jitter, gaps, missing and infinite samples."""

from __future__ import annotations

import numpy as np

from jaxveh.diagnostics.log_findings import LogFinding, LogView, shown_time

GAP = 2.5
"""A step longer than this many usual steps is a gap."""

SLOWEST = 2.0
"""Step above which the motion of a car cannot be observed, s."""

SLOW = 0.5
"""Step of a whole log from which a warning asks for the unit of its time, s: the yaw of a car settles in less."""

QUICKEST = 2e-5
"""Step below which no logger records a car's motion, s."""

CLOCKS = {"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "hours or days": 3600.0}
USUAL_STEP = 0.01
"""Other units of time, s, and the step to which a likely unit leads, s."""

LONG = 10.0
"""A gap longer than this is probably not due to a sensor, s."""

JITTER = 0.05
"""Standard deviation of the steps over the usual step above which sampling is called uneven."""


def check_sampling(log: LogView) -> list[LogFinding]:
    """Check rate, jitter and gaps of each raster (channels with samples in the same rows), and infinite or missing samples."""
    findings, rasters = [], {}
    for name, values in log.channels.items():
        infinite = int(np.isinf(values).sum())
        if infinite:
            where = float(log.time[np.argmax(np.isinf(values))])
            message = f"{infinite} infinite sample(s), the first at {shown_time(where)} s: replace them by NaN."
            findings.append(LogFinding("error", name, message, {"count": infinite, "time": where}))
        present = np.isfinite(values)
        if not present.any():
            findings.append(LogFinding("error", name, "has no finite sample at all: leave the channel out.", {}))
        else:
            rasters.setdefault(present.tobytes(), (present, []))[1].append(name)
    for present, names in rasters.values():
        label = "time" if present.all() else ", ".join(names)
        findings += _raster(label, log.time[present], missing=float(np.mean(~present)))
    return findings


def _raster(label: str, time: np.ndarray, missing: float) -> list[LogFinding]:
    if time.size < 3:
        return [
            LogFinding("error", label, f"has only {time.size} sample(s): at least 3 are needed.", {"count": time.size})
        ]
    steps = np.diff(time)
    usual = float(np.median(steps))
    if not QUICKEST <= usual < SLOWEST:
        likely = min(CLOCKS, key=lambda unit: abs(np.log(usual * CLOCKS[unit] / USUAL_STEP)))
        size = "long" if usual >= SLOWEST else "short"
        message = f"has steps of {usual:.4g} s, too {size} for a car; it looks like {likely}. Set the unit in the channel map."
        return [LogFinding("error", label, message, {"step": usual})]
    gaps = steps > GAP * usual
    jitter = float(np.std(steps[~gaps]) / usual)
    values = {"rate": 1 / usual, "jitter": jitter, "missing": missing, "samples": float(time.size)}
    quiet = f" (missing in {missing:.0%} of the log's rows)" if missing else ""
    regular = LogFinding("ok", label, f"is sampled every {usual * 1e3:.4g} ms, {1 / usual:.4g} Hz{quiet}.", values)
    if label == "time" and usual >= SLOW:
        words = (
            f"has steps of {usual:.4g} s, in which a car's motion comes and goes unseen; does it count rows, or milliseconds of "
            "a quick log? Then set its unit in the channel map; otherwise record at 10 Hz or more."
        )
        regular = LogFinding("warning", label, words, values)
    elif jitter > JITTER:
        words = (
            f"is sampled at {1 / usual:.4g} Hz on average{quiet}, unevenly: the steps' standard deviation is {jitter:.0%} of the "
            "usual step."
        )
        regular = LogFinding("note", label, words, values)
    if not gaps.any():
        return [regular]
    longest = int(np.argmax(steps))
    message = (
        f"{int(gaps.sum())} gap(s), the longest {steps[longest]:.4g} s at {shown_time(time[longest])} s, together "
        f"{steps[gaps].sum():.4g} s. Filters predict across them; fill inputs with --fill, or recording.fill."
    )
    if steps[longest] > LONG:
        message += " A clock that jumped, or two drives in one log? Estimates restart after it."
    return [
        regular,
        LogFinding(
            "warning",
            label,
            message,
            {"count": float(gaps.sum()), "longest": float(steps[longest]), "time": float(time[longest])},
        ),
    ]
