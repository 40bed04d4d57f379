"""Checks of signs and units of angles from their rates: a heading that counts clockwise, a roll angle in degrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jaxveh.diagnostics.log_findings import LogFinding, LogView, fit, is_one
from jaxveh.diagnostics.log_signs import AGREE, SCALED

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

_SMOOTH = 0.5  # s
_CLOCKWISE = "Left is positive, a compass counts clockwise; set sign = -1 in the channel map."


def check_rates(log: LogView) -> list[LogFinding]:
    """Check whether angles and heights follow their rates in sign and scale, where they move."""
    pairs = [(name, rate) for name, rate in RATES.items() if log.has(name, rate)]
    return [finding for name, rate in pairs for finding in _compare(log, name, rate)]


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
    values = log.channels[name]
    known = np.isfinite(values)
    # A wrapped angle stays within a turn: of radians if it fits into one.
    turn = 2.0 * np.pi if np.ptp(values[known]) < 6.3 else 360.0
    jumps = np.max(np.abs(np.diff(values[known])), initial=0.0) > 0.5 * turn
    if name == "z" or not jumps or np.ptp(values[known]) > 1.01 * turn:
        return log.even(name)
    whole = values.copy()
    whole[known] = np.unwrap(values[known], period=turn)
    return replace(log, channels={**log.channels, name: whole}).even(name)
