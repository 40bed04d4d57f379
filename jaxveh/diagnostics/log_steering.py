"""Checks of the steer channel against the car (scale, offset, understeer), and of biases at standstill."""

from __future__ import annotations

import numpy as np

from jaxveh.diagnostics.log_findings import GRAVITY, LogFinding, LogView, fit
from jaxveh.diagnostics.log_single_track import understeer_gradient

GENTLE = 3.0
"""Lateral acceleration up to which tyres count as linear, m/s^2."""

USUAL_WHEELBASE = 2.7
"""Assumed wheelbase of an unknown car, m."""

UNDERSTEERS = (0.0, 0.003)
"""Understeer gradients of cars that are neutral or usual, rad per m/s^2: the file's may be wrong."""

OFFSET = np.deg2rad(0.2)
"""Steering offset above which there is a warning, rad."""

FOLLOWS = 0.5
"""Correlation from which steer follows what a car needs."""

TIGHT = 0.06
"""Angle of the wheelbase seen from a turn's centre from which a turn is tight, rad."""

STANDSTILL = 0.1
"""Speed below which a car counts as standing, m/s."""

_YAW_RATE_BIAS = 0.003


def check_steering(log: LogView) -> list[LogFinding]:
    """Check the scale of steer against the geometry, its offset when the car runs straight, and the understeer gradient."""
    findings = (_standstill(log) if log.has("v_x", "yaw_rate") else []) + _unknown_rear_steer(log)
    if not log.has("steer", "yaw_rate", "v_x"):
        return findings
    speed, yaw_rate = log.smooth(log.even("v_x"), 0.2), log.smooth(log.even("yaw_rate"), 0.2)
    # Turned alike, front and rear wheels do not turn the car.
    steer = log.while_moving(log.smooth(log.even("steer") - log.rear_steer(), 0.2))
    with np.errstate(divide="ignore", invalid="ignore"):
        bend, push = yaw_rate / speed, yaw_rate * speed
        bend = np.where(np.abs(push) < GENTLE, bend, np.nan)
    if np.isfinite(bend * steer).sum() * log.step < 3.0:
        message = f"less than 3 s of driving below {GENTLE:g} m/s^2 of lateral acceleration: offset and scale are not checked."
        return [*findings, LogFinding("note", "steer", message, {})]
    scale = _scale(log, steer, bend, push)
    findings.append(scale)
    if scale.severity in ("ok", "note"):
        findings += _offset(log, steer, bend, push)
    return findings


def _unknown_rear_steer(log: LogView) -> list[LogFinding]:
    """The finding that the rear wheels are turned, which the car's file does not say."""
    there = [name for name in ("steer_rear", "steer_rl", "steer_rr") if log.has(name)]
    if log.car is None or not log.car.steers_front_alone or not there:
        return []
    # Without single spikes.
    usual = {name: float(np.nanquantile(np.abs(log.channels[name]), 0.99)) for name in there}
    name = max(usual, key=lambda one: usual[one])
    if usual[name] <= OFFSET:
        return []
    message = (
        f"is up to {np.rad2deg(usual[name]):.2g} degrees, but the car's file says nothing of steered rear wheels, and every "
        'estimate takes them for straight: set steering = "rear", "four-wheel" or "independent" in the file.'
    )
    return [LogFinding("warning", name, message, {"most": usual[name]})]


def _scale(log: LogView, steer: np.ndarray, bend: np.ndarray, push: np.ndarray) -> LogFinding:
    car = log.car
    wheelbase, own = (USUAL_WHEELBASE, ()) if car is None else (car.wheelbase, (understeer_gradient(car),))
    # A wrong unit is wrong with each of them; a file with wrong stiffnesses is not taken for one.
    fits = [fit(steer, wheelbase * bend + understeer * push) for understeer in (*own, *UNDERSTEERS)]
    followed = [one for one in fits if one[2] >= FOLLOWS and one[0][1] > 0] or fits[:1]
    coefficients, _, correlation = min(followed, key=lambda one: abs(np.log(max(one[0][1], 1e-9))))
    scale = float(coefficients[1])
    values = {"scale": scale, "correlation": correlation}
    # The range is wide because stiffnesses may be wrong by a factor of two; wrong units and steering ratios give larger errors.
    low, high = (0.35, 4.0) if car is None else (0.4, 2.5)
    against = f"a car with an assumed wheelbase of {USUAL_WHEELBASE:g} m" if car is None else "the car"
    if correlation < FOLLOWS or scale <= 0:
        message = f"does not follow the steer that yaw_rate and speed need (correlation {correlation:.2f})."
        return LogFinding("note", "steer", message, values)
    if low <= scale <= high:
        return LogFinding("ok", "steer", f"is {scale:.2f} times what {against} needs in gentle turns.", values)
    guess = "another scale"
    if 8 <= scale < 30:
        guess = f"the steering wheel's angle, with a ratio of about {scale:.0f}"
    elif 30 <= scale < 120:
        guess = "degrees"
    elif scale >= 400:
        guess = "the steering wheel's angle in degrees"
    message = (
        f"is {scale:.3g} times what {against} needs in gentle turns: it looks like {guess}. Set unit or scale in the "
        "channel map so that steer is the angle at the road wheels in rad."
    )
    return LogFinding("error", "steer", message, values)


def _offset(log: LogView, steer: np.ndarray, bend: np.ndarray, push: np.ndarray) -> list[LogFinding]:
    """Fit steer = offset + L yaw_rate / v_x + K v_x yaw_rate + T dsteer/dt with the car's L; without a car L is fitted instead
    of T.

    Tight turns are left out: there, two per cent of the ratio outweigh the understeer."""
    bend = np.where(np.abs(bend) * (log.car.wheelbase if log.car else USUAL_WHEELBASE) < TIGHT, bend, np.nan)
    if np.isfinite(bend * steer).sum() * log.step < 3.0:
        message = "less than 3 s of driving in bends that are not tight: offset and understeer are not checked."
        return [LogFinding("note", "steer", message, {})]
    if log.car is None:
        coefficients, errors, correlation = fit(steer, bend, push)
    else:
        # While the steer turns, the yaw rate is still behind it.
        coefficients, errors, correlation = fit(steer - log.car.wheelbase * bend, push, log.slope(steer))
    offset, error = float(coefficients[0]), float(errors[0])
    told = (log.car.steer_offset if log.car else None) or 0.0
    rest = offset - told
    values = {"offset": offset, "error": error}
    words = f"shows {np.rad2deg(offset):+.2f} degrees (+-{np.rad2deg(2 * error):.2f}) when the car runs straight"
    if told:
        words += f"; the car file has {np.rad2deg(told):+.2f}"
    findings = [LogFinding("ok", "steer", f"{words}.", values)]
    if abs(rest) > max(OFFSET, 3 * error):
        advice = "subtract it in the channel map, set steer_offset in the car's file, or let calibration estimate it"
        findings = [LogFinding("warning", "steer", f"{words}: {advice} (a yaw-rate bias has the same effect).", values)]
    if log.car is None:
        return findings
    measured, expected, spread = float(coefficients[1]), understeer_gradient(log.car), float(errors[1])
    values = {"measured": measured, "expected": expected, "error": spread, "correlation": correlation}
    words = (
        f"understeer gradient of {_degrees_a_g(measured):+.2f} degrees per g (+-{_degrees_a_g(2 * spread):.2f}); the car's "
        f"stiffnesses give {_degrees_a_g(expected):+.2f}."
    )
    off = abs(measured - expected)
    far = _degrees_a_g(off) > 1.5 and off > 3 * spread
    advice = " Check stiffnesses, masses and axle distances."
    return [*findings, LogFinding("warning" if far else "ok", "steer", words + (advice if far else ""), values)]


def _degrees_a_g(gradient: float) -> float:
    return float(np.rad2deg(gradient) * GRAVITY)


def _standstill(log: LogView) -> list[LogFinding]:
    speed, yaw_rate = log.even("v_x"), log.even("yaw_rate")
    with np.errstate(invalid="ignore"):
        rows = (np.abs(speed) < STANDSTILL) & np.isfinite(yaw_rate)
    if rows.sum() * log.step < 2.0:
        return []
    bias = float(np.median(yaw_rate[rows]))
    words = f"shows {bias:+.2g} rad/s at standstill"
    if abs(bias) > _YAW_RATE_BIAS:
        return [LogFinding("warning", "yaw_rate", f"{words}: subtract this bias in the channel map.", {"bias": bias})]
    return [LogFinding("ok", "yaw_rate", f"{words}.", {"bias": bias})]
