"""Checks of the wheel speeds: with v_x, with each other, and of both sides with the yaw rate."""

from __future__ import annotations

import numpy as np

from jaxveh.diagnostics.log_findings import SCALED, LogFinding, LogView, fit

SAME_SPEED = (0.8, 1.25)
"""Ratios of the wheels' speed to v_x that count as 1."""

OWN_UNIT = (0.5, 1.8)
"""Ratios of one wheel's speed to the speed beyond which it has a unit of its own, or does not turn: a wheel that spins or locks
does so in few rows."""

FEWEST = 100
"""Least number of moving rows."""

SIDES = (("fl", "fr"), ("rl", "rr"))


def check_wheel_speeds(log: LogView) -> list[LogFinding]:
    """Check whether v_x agrees with the wheel speeds, the wheels with each other, and both sides with the yaw rate."""
    return [*_together(log), *_each(log), *_sides(log)]


def _together(log: LogView) -> list[LogFinding]:
    ratio = wheels_over_speed(log)
    if ratio is None:
        return []
    values, story = {"ratio": ratio}, f"the wheels' speeds are {ratio:.3g} times v_x"
    if SAME_SPEED[0] < ratio < SAME_SPEED[1]:
        return [LogFinding("ok", "v_x", f"{story}.", values)]
    for factor, unit in ((1 / 3.6, "km/h"), (0.44704, "mph")):
        if abs(np.log(ratio / factor)) < np.log(1.15):
            return [LogFinding("error", "v_x", f"{story}: v_x looks like {unit}. Set it in the channel map.", values)]
    return [LogFinding("warning", "v_x", f"{story}, which should be 1: the wheels in rad/s or km/h?", values)]


def wheels_over_speed(log: LogView) -> float | None:
    """Return the median of all wheel speeds over v_x in moving rows; None if there are too few rows."""
    wheels = [values for name, values in log.channels.items() if name.startswith("wheel_speed")]
    if not wheels or not log.has("v_x"):
        return None
    known = _ratios(log, np.stack(wheels), log.channels["v_x"])
    return float(np.median(known)) if known.size >= FEWEST else None


def _ratios(log: LogView, wheels: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the finite ratios of wheels (..., T) to a speed (T,) in moving rows, one after the other."""
    with np.errstate(invalid="ignore"):
        ratios = wheels / np.where(speed > log.least_speed, speed, np.nan)
    return ratios[np.isfinite(ratios)]


def _each(log: LogView) -> list[LogFinding]:
    """Report wheels whose speed is no speed of this car while most wheels' speeds are: a corner with a unit of its own."""
    wheels = {name: log.channels[name] for one in SIDES for at in one if log.has(name := f"wheel_speed_{at}")}
    if len(wheels) < 3:
        return []
    middle = np.median(np.stack(list(wheels.values())), axis=0)
    findings = []
    for name, values in wheels.items():
        known = _ratios(log, values, middle)
        ratio = float(np.median(known)) if known.size >= FEWEST else 1.0
        if not OWN_UNIT[0] < ratio < OWN_UNIT[1]:
            message = (
                f"is {ratio:.3g} times the other wheels' speed: it does not turn, or has another unit (km/h is 3.6, mph 2.24, "
                "rad/s one over the radius). Set its unit in the channel map, or leave it out."
            )
            findings.append(LogFinding("error", name, message, {"ratio": ratio}))
    return findings


def _sides(log: LogView) -> list[LogFinding]:
    """Report axles on which the left wheel is the faster one in turns to the left."""
    findings = []
    for kind in ("wheel_speed", "omega"):
        for left, right in SIDES:
            names = f"{kind}_{left}", f"{kind}_{right}"
            if log.has("yaw_rate", *names):
                findings += _swapped(log, *names)
    return findings


def _swapped(log: LogView, left: str, right: str) -> list[LogFinding]:
    smooth = lambda name: log.smooth(log.even(name), 0.3)
    apart = smooth(right) - smooth(left)
    coefficients, _, correlation = fit(log.while_moving(apart) if log.has("v_x") else apart, smooth("yaw_rate"))
    slope = float(coefficients[1])
    values = {"slope": slope, "correlation": correlation}
    if correlation < SCALED:
        return []
    story = f"{right} less {left} is {slope:.3g} times yaw_rate (correlation {correlation:.2f})"
    if slope > 0:
        return [LogFinding("ok", f"{left}, {right}", f"{story}.", values)]
    message = (
        f"{story}, which should be positive, about the track: left and right are swapped. Name the columns the other way round "
        "in the channel map; if steer and a_y contradict yaw_rate, too, its sign is wrong."
    )
    return [LogFinding("error", f"{left}, {right}", message, values)]
