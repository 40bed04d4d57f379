"""Samples that are suspicious in themselves: held, frozen, coarse, spikes."""

from __future__ import annotations

import numpy as np

from jaxveh.diagnostics.log_findings import LogFinding, LogView

HELD = 0.1
"""Share of samples equal to the one before above which a channel is said to repeat."""

FROZEN = 1.0
"""Seconds without any change, while the channel moves elsewhere, that look like a sensor that stopped."""

NEVER_STILL = ("v_x", "v_y", "a_x", "a_y", "yaw_rate", "roll_rate", "sideslip")
"""Channels that always change while a car moves. Others (pedals, a steer that is held) may stand still, and nothing is wrong."""

JUMPY = ("throttle", "brake", "wheel_speed", "drive_torque", "gear")
"""Beginnings of names of channels that may jump, and nothing is wrong."""

SPIKE = 8.0
"""Robust deviations from the running median that make a spike, if also `SPIKE_RANGE` of the channel's range."""

SPIKE_RANGE = 0.1
_HALF_WINDOW = 3


def check_samples(log: LogView) -> list[LogFinding]:
    """Repeated values (the true update rate), frozen stretches, coarse steps and spikes of every channel."""
    findings = []
    for name, values in log.channels.items():
        present = np.isfinite(values)
        if present.sum() < 10:
            continue
        time, samples = log.time[present], values[present]
        if np.all(samples == samples[0]):
            message = f"is {samples[0]:g} throughout: a sensor that does not speak, or a manoeuvre without it."
            findings.append(LogFinding("note", name, message, {"value": float(samples[0])}))
            continue
        coarse = _resolution(samples)
        still = _repeats(name, time, samples, coarse, _resting(log, time))
        findings += still if name in NEVER_STILL else _told(still)
        findings += _told(_spikes(name, time, samples)) if name.startswith(JUMPY) else _spikes(name, time, samples)
    return findings


def _told(findings: list[LogFinding]) -> list[LogFinding]:
    """Findings that need no warning."""
    return [one._replace(severity="note") if one.severity == "warning" else one for one in findings]


def _resting(log: LogView, time: np.ndarray) -> np.ndarray:
    """Whether the car stands, as far as is known, at these times."""
    if not log.has("v_x"):
        return np.zeros(time.shape, bool)
    speed, known = log.channels["v_x"], np.isfinite(log.channels["v_x"])
    return np.interp(time, log.time[known], np.abs(speed[known])) < 0.1 * log.least_speed


def _resolution(samples: np.ndarray) -> float:
    """The step of a coarsely quantised channel: every change is a multiple of it; 0 where there is none."""
    changes = np.abs(np.diff(samples))
    changes = changes[changes > 0]
    step = changes.min()
    count = changes / step
    coarse = np.abs(count - np.round(count)).max() < 1e-3 and np.ptp(samples) / step < 4096
    return float(step) if coarse and np.median(count) < 4 else 0.0


def _repeats(name: str, time: np.ndarray, samples: np.ndarray, coarse: float, resting: np.ndarray) -> list[LogFinding]:
    starts = np.flatnonzero(np.r_[True, np.diff(samples) != 0])
    lengths = np.diff(np.r_[starts, samples.size])
    share = 1 - starts.size / samples.size
    rate = (samples.size - 1) / (time[-1] - time[0])
    if coarse:
        if share <= HELD:
            return []
        message = f"comes in steps of {coarse:.3g}: finer detail is lost, and so are {share:.0%} of its changes."
        return [LogFinding("note", name, message, {"resolution": coarse, "repeated": share})]
    findings = []
    ends = np.minimum(starts + lengths - 1, samples.size - 1)
    durations = time[ends] - time[starts]
    frozen = (durations > max(FROZEN, 5 * np.median(durations))) & ~(resting[starts] & resting[ends])
    if frozen.any():
        worst = int(np.argmax(durations))
        message = (
            f"stands still {int(frozen.sum())} time(s) for more than {FROZEN:g} s, the longest {durations[worst]:.4g} s "
            f"at {time[starts[worst]]:.6g} s: a dropout that repeats the last value? Blank those rows."
        )
        values = {"count": float(frozen.sum()), "longest": float(durations[worst]), "time": float(time[starts[worst]])}
        findings.append(LogFinding("warning", name, message, values))
    moving = ~frozen
    repeated = 1 - moving.sum() / lengths[moving].sum()
    if repeated > HELD:
        message = f"repeats {repeated:.0%} of its samples: new values come at about {rate * (1 - repeated):.3g} Hz."
        findings.append(
            LogFinding("note", name, message, {"repeated": float(repeated), "rate": float(rate * (1 - repeated))})
        )
    return findings


def _spikes(name: str, time: np.ndarray, samples: np.ndarray) -> list[LogFinding]:
    """Hampel's identifier with the deviation of the whole channel: up to three samples far off their neighbours."""
    width = 2 * _HALF_WINDOW + 1
    if samples.size <= width:
        return []
    padded = np.pad(samples, _HALF_WINDOW, mode="edge")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    off = np.abs(samples - median)
    low, high = np.quantile(samples, [0.01, 0.99])
    usual = 1.4826 * np.median(off[off > 0]) if np.any(off > 0) else 0.0
    found = off > max(SPIKE * usual, SPIKE_RANGE * (high - low))
    if not found.any():
        return [LogFinding("ok", name, "has no spikes.", {"count": 0.0})]
    worst = int(np.argmax(off))
    message = (
        f"{int(found.sum())} spike(s), the largest {samples[worst]:.4g} at {time[worst]:.6g} s where its neighbours "
        f"say {median[worst]:.4g}. Blank them, or use a heavy-tailed noise law."
    )
    values = {"count": float(found.sum()), "time": float(time[worst]), "value": float(samples[worst])}
    return [LogFinding("warning", name, message, values)]
