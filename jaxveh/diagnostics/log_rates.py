"""Checks of signs and units of angles from their rates: a heading that counts clockwise, a roll angle in degrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jaxveh.diagnostics.log_findings import AGREE, SCALED, LogFinding, LogView, fit, is_one, shown_time, without_jumps

RATES = {
    "yaw": "yaw_rate",
    "heading": "yaw_rate",
    "course": "yaw_rate",
    "roll": "roll_rate",
    "pitch": "pitch_rate",
    "steering_wheel": "steering_wheel_rate",
    "z": "climb_rate",
}
"""Channels and those of their rates. The course's also has the rate of the sideslip angle, which has no mean."""

OVER_GROUND = ("course", "heading")
"""Directions that are measured over ground: while the car moves."""

TURNS = ("yaw", "heading", "course", "steering_wheel")
"""Angles that may jump by whole turns."""

FULL = (2.0 * np.pi, 360.0)
"""A full turn in rad, and in degrees."""

NO_TURN = 0.05
"""Share of a turn by which a jump may differ from whole turns, beside the change of the rows around it."""

QUICKEST_TURN = 2.5
"""Yaw rate up to which a car may turn between two samples of a receiver that repeats the last one, rad/s."""

_BESIDE = 5  # samples on either side of a jump

_SMOOTH = 0.5  # s
_CLOCKWISE = "Left is positive, a compass counts clockwise; set sign = -1 in the channel map."


def check_rates(log: LogView) -> list[LogFinding]:
    """Check whether angles and heights follow their rates in sign and scale, where they move, and jump by whole turns only."""
    pairs = [(name, rate) for name, rate in RATES.items() if log.has(name, rate)]
    compared = [finding for name, rate in pairs for finding in _compare(log, name, rate)]
    return compared + [finding for name in TURNS if log.has(name) for finding in _jumps(log, name)]


def _jumps(log: LogView, name: str) -> list[LogFinding]:
    """Report jumps by more than half a turn to another level that are no whole turns: a counter that overflows."""
    known = np.isfinite(log.channels[name])
    if name in OVER_GROUND:
        # A car that stands has no direction over ground.
        speed = next((log.channels[one] for one in ("v_x", "speed") if log.has(one)), np.zeros(log.time.shape))
        with np.errstate(invalid="ignore"):
            known &= np.interp(log.time, log.time[np.isfinite(speed)], speed[np.isfinite(speed)]) > log.least_speed
    time, samples = log.time[known], log.channels[name][known]
    if samples.size < 4 * _BESIDE:
        return []
    changes = np.diff(samples)
    around = lambda values: np.median(np.lib.stride_tricks.sliding_window_view(values, _BESIDE), axis=-1)
    # Each change but for the first and last few, beside the usual one there, and the change of the level.
    rows = np.arange(_BESIDE - 1, changes.size - _BESIDE + 1)
    usual = around(np.pad(changes, _BESIDE // 2, mode="edge"))[rows]
    step, level = changes[rows] - usual, around(samples)[_BESIDE:] - around(samples)[:-_BESIDE]
    # A receiver of 1 Hz in rows of 20 Hz: the car has turned since its last sample, not since the last row.
    news = np.maximum.accumulate(np.where(np.r_[True, changes != 0.0], np.arange(samples.size), 0))
    turned = QUICKEST_TURN * (time[1:] - time[news[:-1]])[rows] / FULL[0]
    off = [np.abs(step - turn * np.round(step / turn)) < (NO_TURN + turned) * turn for turn in FULL]
    whole = np.any([near & (np.abs(step) > 0.5 * turn) for near, turn in zip(off, FULL, strict=True)], axis=0)
    soon = np.diff(time)[rows] < 2.5 * np.median(np.diff(time))
    found = (np.abs(step) > 0.5 * FULL[0]) & (np.abs(level) > 0.5 * np.abs(step)) & ~whole & soon
    if not found.any():
        return []
    first = int(np.argmax(found))
    message = (
        f"jumps {int(found.sum())} time(s) by what is no whole turn, first by {step[first]:.4g} rad at "
        f"{shown_time(time[rows[first] + 1])} s: a counter that overflows? Add the jump to the rows after it."
    )
    values = {"count": float(found.sum()), "time": float(time[rows[first] + 1]), "jump": float(step[first])}
    return [LogFinding("error", name, message, values)]


def _compare(log: LogView, name: str, rate: str) -> list[LogFinding]:
    change = log.smooth(log.slope(_unwrapped(log, name)), _SMOOTH)
    if name in OVER_GROUND and log.has("v_x"):
        change = log.while_moving(change)
    coefficients, _, correlation = fit(change, log.smooth(log.even(rate), _SMOOTH))
    slope = float(coefficients[1])
    values = {"slope": slope, "correlation": correlation}
    story = f"changes by {slope:.3g} times {rate} (correlation {correlation:.2f})"
    if correlation < AGREE:
        return []
    if name in OVER_GROUND and not log.is_slow(log.even(rate)):
        return [LogFinding("note", name, f"{story}: its turns are too quick to tell of signs and units.", values)]
    if slope < 0:
        turns = rate == "yaw_rate"
        advice = _CLOCKWISE if turns else "Set sign = -1 in the channel map."
        instead = () if turns else (rate,)  # a yaw rate is compared with the lateral acceleration
        return [LogFinding("error", name, f"{story}: one of the two has the wrong sign. {advice}", values, instead)]
    if is_one(slope):
        return [LogFinding("ok", name, f"{story}.", values)]
    if correlation < SCALED:
        return []
    for factor, wrong in ((180 / np.pi, name), (np.pi / 180, rate)):
        if name != "z" and abs(np.log(slope / factor)) < np.log(1.25):
            message = (
                f"{story}: {wrong} looks like degrees{' per second' * (wrong == rate)}. Set it in the channel map."
            )
            return [LogFinding("error", wrong, message, values)]
    if name == "course":
        return [LogFinding("note", name, f"{story}: a car that slides, or a wrong unit or scale?", values)]
    return [LogFinding("warning", name, f"{story}, which should be 1: a wrong unit or scale?", values)]


def _unwrapped(log: LogView, name: str) -> np.ndarray:
    """The channel on the grid without the jumps of a full turn, in radians or degrees, of an angle that is wrapped."""
    if name == "z":
        return log.even(name)
    whole = log.channels[name].copy()
    known = np.isfinite(whole)
    whole[known] = without_jumps(whole[known])
    return replace(log, channels={**log.channels, name: whole}).even(name)
