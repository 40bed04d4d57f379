"""Checks of the samples of single channels: repeated values, frozen stretches, coarse steps, spikes."""

from __future__ import annotations

import re

import numpy as np

from jaxveh.diagnostics.log_findings import LogFinding, LogView, shown_time, without_jumps
from jaxveh.io import kit

HELD = 0.1
"""Share of samples equal to the previous one above which a channel is reported to repeat."""

FROZEN = 1.0
"""Time without any change, in a channel that changes elsewhere, that is reported as a stopped sensor, s."""

NEVER_STILL = ("v_x", "v_y", "a_x", "a_y", "yaw_rate", "roll_rate", "sideslip")
"""Channels that always change while a car moves. Others (pedals, a held steer) may be constant although nothing is wrong."""

JUMPY = ("throttle", "brake", "wheel_speed", "drive_torque", "gear")
"""Beginnings of the names of channels that may jump although nothing is wrong."""

DIRECTION = r"\b(yaw|heading|course|bearing|azimuth|psi|hdg|cog)\b"
CHANGE = r"\b(rate|vel\w*|speed|dot|acc\w*|gyro\w*|std|cov\w*|accuracy)\b"
"""Words in the names of directions, which jump by whole turns, and in those of what is none."""

TURNING = 0.5
"""Standard deviation of the lateral acceleration of a moving car, m/s^2, with which neither its yaw rate nor its a_y can be
constant: a straight drive on a level road has the noise of its sensors, 0.1 or so."""

SPIKE = 8.0
"""A sample is a spike if it is this many robust deviations, and `SPIKE_RANGE` of the range, off the running median."""

SPIKE_RANGE = 0.1
_HALF_WINDOW = 3


def check_samples(log: LogView) -> list[LogFinding]:
    """Check every channel for repeated values (the true update rate), frozen stretches, coarse steps and spikes."""
    findings = []
    for name, values in log.channels.items():
        present = np.isfinite(values)
        if present.sum() < 10:
            continue
        time, samples = log.time[present], values[present]
        if np.all(samples == samples[0]):
            if (turning := _contradicted(log, name)) is not None:
                findings.append(turning)
                continue
            why = ": the sensor does not work, or the manoeuvre does not excite it" if name in NEVER_STILL else ""
            findings.append(
                LogFinding("note", name, f"is constant at {samples[0]:g}{why}.", {"value": float(samples[0])})
            )
            continue
        coarse = _resolution(samples)
        still = _repeats(name, time, samples, coarse, _resting(log, time))
        findings += still if name in NEVER_STILL else _told(still)
        words = kit.words_of(name)
        if re.search(DIRECTION, words) is not None and re.search(CHANGE, words) is None:
            samples = without_jumps(samples)
        findings += _told(_spikes(name, time, samples)) if name.startswith(JUMPY) else _spikes(name, time, samples)
    return findings


def _contradicted(log: LogView, name: str) -> LogFinding | None:
    """Return the finding about a constant yaw rate while a_y varies, or a constant a_y while the yaw rate does; else None."""
    other = {"yaw_rate": "a_y", "a_y": "yaw_rate"}.get(name)
    if other is None or not log.has("v_x", other):
        return None
    v_x = log.even("v_x")
    lateral = log.even(other) * (v_x if other == "yaw_rate" else 1.0)
    lateral = lateral[(np.abs(v_x) > log.least_speed) & np.isfinite(lateral)]
    if lateral.size < 10 or np.std(lateral) < TURNING:
        return None
    constant = float(log.channels[name][np.isfinite(log.channels[name])][0])
    message = f"is constant at {constant:g} while {other} shows turns: the sensor does not work; leave the channel out."
    return LogFinding("error", name, message, {"value": constant})


def _told(findings: list[LogFinding]) -> list[LogFinding]:
    """Return the findings with warnings lowered to notes."""
    return [one._replace(severity="note") if one.severity == "warning" else one for one in findings]


def _resting(log: LogView, time: np.ndarray) -> np.ndarray:
    """Whether the car stands at these times, as far as the log shows."""
    if not log.has("v_x"):
        return np.zeros(time.shape, bool)
    speed, known = log.channels["v_x"], np.isfinite(log.channels["v_x"])
    return np.interp(time, log.time[known], np.abs(speed[known])) < 0.1 * log.least_speed


def _resolution(samples: np.ndarray) -> float:
    """Return the step of a coarsely quantised channel, whose changes are multiples of it; 0 if there is none."""
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
        message = f"is quantised in steps of {coarse:.3g}: finer detail is lost, and so are {share:.0%} of its changes."
        return [LogFinding("note", name, message, {"resolution": coarse, "repeated": share})]
    findings = []
    ends = np.minimum(starts + lengths - 1, samples.size - 1)
    durations = time[ends] - time[starts]
    frozen = (durations > max(FROZEN, 5 * np.median(durations))) & ~(resting[starts] & resting[ends])
    if frozen.any():
        worst = int(np.argmax(durations))
        message = (
            f"stays constant {int(frozen.sum())} time(s) for more than {FROZEN:g} s, the longest {durations[worst]:.4g} s "
            f"at {shown_time(time[starts[worst]])} s: a dropout that repeats the last value? Set those rows to NaN."
        )
        values = {"count": float(frozen.sum()), "longest": float(durations[worst]), "time": float(time[starts[worst]])}
        findings.append(LogFinding("warning", name, message, values))
    moving = ~frozen
    repeated = 1 - moving.sum() / lengths[moving].sum()
    if repeated > HELD:
        message = f"repeats {repeated:.0%} of its samples: its true rate is about {rate * (1 - repeated):.3g} Hz."
        findings.append(
            LogFinding("note", name, message, {"repeated": float(repeated), "rate": float(rate * (1 - repeated))})
        )
    return findings


def _spikes(name: str, time: np.ndarray, samples: np.ndarray) -> list[LogFinding]:
    """Find spikes of up to three samples by Hampel's identifier, with the deviation of the whole channel."""
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
        f"{int(found.sum())} spike(s), the largest {samples[worst]:.4g} at {shown_time(time[worst])} s where its neighbours "
        f"have {median[worst]:.4g}. Set them to NaN, or use a heavy-tailed noise law."
    )
    values = {"count": float(found.sum()), "time": float(time[worst]), "value": float(samples[worst])}
    return [LogFinding("warning", name, message, values)]
