"""Checks of signs and units from channels that must agree: steer with yaw rate, accelerations with speeds."""

from __future__ import annotations

import numpy as np

from jaxveh.diagnostics.log_findings import AGREE, GRAVITY, SCALED, LogFinding, LogView, fit, is_one
from jaxveh.diagnostics.log_steering import GENTLE
from jaxveh.diagnostics.log_wheels import SAME_SPEED, wheels_over_speed
from jaxveh.io import CarSpecification

SHIFTED = 1.0
"""m/s^2: a unit scales a channel and does not shift it: with a larger intercept no slope is attributed to one."""

# The units that explain a slope other than 1, for a_y over v_x yaw_rate and for a_x over dv_x/dt.
_LATERAL = {
    1 / 3.6: ("v_x", "km/h"),
    0.44704: ("v_x", "mph"),
    np.pi / 180: ("yaw_rate", "deg/s"),
    1 / GRAVITY: ("a_y", "g"),
    np.pi / 180 / 3.6: ("v_x and yaw_rate", "km/h and deg/s"),
}
_LONGITUDINAL = {1 / 3.6: ("v_x", "km/h"), 0.44704: ("v_x", "mph"), 1 / GRAVITY: ("a_x", "g")}

_ARMS = ((1.35, 1.35), (2.5, 2.5))
"""Two distances of a car and of a truck in m: from the centre of gravity to the rear axle, and yaw inertia over m a."""


def check_signs(log: LogView) -> list[LogFinding]:
    """Check whether the signs of steer, yaw rate and lateral acceleration agree, and the accelerations follow the speeds."""
    findings = []
    wheels = wheels_over_speed(log)
    confirmed = wheels is not None and SAME_SPEED[0] < wheels < SAME_SPEED[1]
    steering = _correlation(log) if log.has("steer", "yaw_rate", "v_x") else None
    lateral = _lateral(log) if log.has("v_x", "yaw_rate", "a_y") else None
    if steering is not None:
        findings.append(_steering(steering, _correlation(log, GENTLE), lateral))
    if lateral is not None:
        slides = _slides(lateral, _lateral(log, GENTLE)) or _turns_quickly(log, lateral)
        told = slides or _if_slow(log, _slope("a_y", "v_x yaw_rate", lateral, _LATERAL, "yaw_rate or a_y"))
        findings.append(_refuted(told, "a_y", "v_x yaw_rate") if confirmed else told)
    if log.has("v_x", "v_y", "yaw_rate", "a_y"):
        findings += _sideways(log)
    if log.has("v_x", "a_x"):
        told = _slope("a_x", "dv_x/dt", _longitudinal(log), _LONGITUDINAL, "a_x")
        findings.append(_refuted(told, "a_x", "dv_x/dt") if confirmed else told)
    return findings


def _refuted(finding: LogFinding, name: str, other: str) -> LogFinding:
    """The finding of a comparison in a log whose wheels confirm v_x: an acceleration that was planned, not measured, must not
    make an error of it."""
    if finding.severity != "error" or finding.channel != "v_x":
        return finding
    story = _story(other, finding.values["slope"], finding.values["intercept"])
    message = f"{story}, but the wheels confirm v_x: was it planned, not measured, or is its scale wrong?"
    return finding._replace(severity="warning", channel=name, message=message)


def _correlation(log: LogView, most: float = np.inf) -> float:
    """The correlation of yaw rate and steer where |v_x yaw_rate| has been at most `most` (m/s^2) for half a second, and stays."""
    steer = log.smooth(log.even("steer") - log.rear_steer(), 0.2)
    yaw_rate = log.smooth(log.even("yaw_rate"), 0.2)
    yaw_rate = _gentle(log, log.even("v_x") * yaw_rate, most, yaw_rate)
    coefficients, _, correlation = fit(log.while_moving(yaw_rate), steer)
    return correlation * float(np.sign(coefficients[1]))


def _gentle(log: LogView, push: np.ndarray, most: float, values: np.ndarray) -> np.ndarray:
    """The values where |push| (m/s^2) has been at most `most` for half a second, and stays; NaN elsewhere."""
    with np.errstate(invalid="ignore"):
        hard = np.abs(push) > most
    around = 2 * round(0.5 / log.step) + 1
    return np.where(np.convolve(hard, np.ones(around), "same") > 0.5, np.nan, values) if hard.size >= around else values


def _lateral(log: LogView, most: float = np.inf) -> tuple[float, float, float]:
    """Return slope, intercept and correlation of a_y over v_x yaw_rate where |a_y| has been at most `most` (m/s^2) for half a
    second, and stays."""
    speed, yaw_rate = log.even("v_x"), log.even("yaw_rate")
    target = log.while_moving(_gentle(log, log.even("a_y"), most, log.smooth(log.even("a_y"), 0.2)))
    turning = log.smooth(speed * yaw_rate, 0.2)
    coefficients, _, correlation = fit(target, turning)
    return float(coefficients[1]), float(coefficients[0]), correlation


def _sideways(log: LogView) -> list[LogFinding]:
    """Check whether dv_y/dt follows a_y - v_x yaw_rate; there is no finding if the two are hardly correlated."""
    rest = log.smooth(log.even("a_y") - log.even("v_x") * log.even("yaw_rate"), 0.3)
    change = log.while_moving(log.smooth(log.slope(log.even("v_y")), 0.3))
    coefficients, _, correlation = fit(change, rest)
    slope = float(coefficients[1])
    values = {"slope": slope, "correlation": correlation}
    if correlation < AGREE:
        return []
    if slope < 0:
        message = "has a rate opposite to a_y - v_x yaw_rate: v_y has the wrong sign. Left is positive; set sign = -1."
        return [LogFinding("error", "v_y", message, values)]
    return [LogFinding("ok", "v_y", f"agrees with a_y - v_x yaw_rate (correlation {correlation:.2f}).", values)]


def _longitudinal(log: LogView) -> tuple[float, float, float]:
    speed = log.even("v_x")
    change = log.slope(speed)
    if log.has("v_y", "yaw_rate"):
        change = change - log.even("v_y") * log.even("yaw_rate")
    target = log.smooth(log.even("a_x"), 0.3)
    coefficients, _, correlation = fit(target, log.smooth(change, 0.3))
    return float(coefficients[1]), float(coefficients[0]), correlation


def _steering(correlation: float, gently: float, lateral: tuple[float, float, float] | None) -> LogFinding:
    values = {"correlation": correlation}
    if correlation > AGREE:
        return LogFinding("ok", "steer", f"agrees in sign with yaw_rate (correlation {correlation:.2f}).", values)
    if correlation > -AGREE:
        message = (
            f"has little to do with yaw_rate (correlation {correlation:.2f}): too little steering, or wrong columns?"
        )
        return LogFinding("note", "steer", message, values)
    if gently > 0.0:
        message = (
            f"steers against yaw_rate (correlation {correlation:.2f}), but not in gentle turns: a car that slides."
        )
        return LogFinding("note", "steer", message, values)
    agrees = lateral is not None and lateral[2] > AGREE and lateral[0] > 0
    opposed = lateral is not None and lateral[2] > AGREE and lateral[0] < 0
    wrong = "steer" if agrees else "yaw_rate" if opposed else "steer or yaw_rate"
    channel, _, instead = wrong.partition(" or ")
    message = (
        f"steer and yaw_rate are opposite (correlation {correlation:.2f}): {wrong} has the wrong sign. Left is "
        "positive; set sign = -1 in the channel map."
    )
    return LogFinding("error", channel, message, values, (instead,) if instead else ())


def _slides(line: tuple[float, float, float], gently: tuple[float, float, float]) -> LogFinding | None:
    """The finding that a_y differs from v_x yaw_rate, but not in gentle turns, as of a car that spins; None otherwise."""
    if is_one(line[0]) or not is_one(gently[0]) or gently[2] < SCALED:
        return None
    message = f"is {line[0]:.3g} times v_x yaw_rate, in gentle turns {gently[0]:.3g} times: a car that slides."
    return LogFinding("note", "a_y", message, {"slope": line[0], "gently": gently[0], "correlation": gently[2]})


def _turns_quickly(log: LogView, line: tuple[float, float, float]) -> LogFinding | None:
    """The finding that a_y differs from v_x yaw_rate, but not from v_x yaw_rate + dv_y/dt, as in quick turns; None otherwise."""
    if line[2] < AGREE or is_one(line[0]):
        return None
    arms = _ARMS if log.car is None else (_arms(log.car),)
    slopes = [slope for one in arms if (slope := _with_sideslip(log, *one)) is not None]
    if not slopes:
        return None
    message = f"is {line[0]:.3g} times v_x yaw_rate, with the rate of the sideslip {slopes[0]:.3g} times: turns that are quick."
    return LogFinding("note", "a_y", message, {"slope": line[0], "with_sideslip": slopes[0], "correlation": line[2]})


def _if_slow(log: LogView, found: LogFinding) -> LogFinding:
    """The finding about a_y; one of a unit is a warning if all turns are quick: dv_y/dt has any share in a_y then."""
    if found.severity != "error" or found.values["slope"] < 0 or log.is_slow(log.while_moving(log.even("yaw_rate"))):
        return found
    return found._replace(
        severity="warning", message=f"{found.message} Quick turns look alike, and there are no slow ones."
    )


def _arms(car: CarSpecification) -> tuple[float, float]:
    return car.rear_axle_to_cg, car.yaw_inertia / (car.mass * car.front_axle_to_cg)


def _with_sideslip(log: LogView, arm: float, inertia: float) -> float | None:
    """Return a_y over v_x yaw_rate + dv_y/dt; None if it is not 1, or a_y does not follow.

    A linear rear axle has v_y = b yaw_rate - K v_x (a_y - I/(m a) dyaw_rate/dt): b is the `arm` (m), I/(m a) the `inertia` (m),
    and K (rad per m/s^2) is fitted, too."""
    twice = lambda name: log.smooth(log.smooth(log.even(name), 0.2), 0.2)  # for a rate of a rate
    speed, yaw_rate, a_y = log.even("v_x"), twice("yaw_rate"), twice("a_y")
    turning = speed * yaw_rate + arm * log.slope(yaw_rate)
    pushed = -speed * log.slope(a_y - inertia * log.slope(yaw_rate))
    (_, slope, softness), _, correlation = fit(log.while_moving(a_y), turning, pushed)
    return float(slope) if is_one(slope) and softness > 0.0 and correlation > SCALED else None


def _story(other: str, slope: float, intercept: float) -> str:
    return f"is {slope:.3g} times {other} {'+' if intercept >= 0 else '-'} {abs(intercept):.2g} m/s^2"


def _slope(name: str, other: str, line: tuple[float, float, float], table: dict, blamed: str) -> LogFinding:
    slope, intercept, correlation = line
    values = {"slope": slope, "intercept": intercept, "correlation": correlation}
    story = _story(other, slope, intercept)
    if correlation < AGREE:
        message = (
            f"{story}, but hardly follows it (correlation {correlation:.2f}): too little motion to compare, or noise."
        )
        return LogFinding("note", name, message, values)
    if slope < 0:
        instead = tuple(one for one in blamed.split(" or ") if one != name)
        message = f"{story}: {blamed} has the wrong sign. Set sign = -1 in the channel map."
        return LogFinding("error", name, message, values, instead)
    if is_one(slope):
        if abs(intercept) > 0.5:
            return LogFinding("warning", name, f"{story}: a bias of {intercept:.2g} m/s^2, or a banked road.", values)
        return LogFinding("ok", name, f"{story} (correlation {correlation:.2f}).", values)
    factors = {factor: guess for factor, guess in table.items() if abs(np.log(slope / factor)) < np.log(1.25)}
    if correlation < SCALED:
        message = f"{story}, not 1, and follows it loosely (correlation {correlation:.2f}): a damaged or late channel?"
        return LogFinding("warning", name, message, values)
    if factors and abs(intercept) < SHIFTED:
        nearest = min(factors, key=lambda factor: abs(np.log(slope / factor)))
        channel, unit = factors[nearest]
        if channel != name:
            story = f"disagrees with {name}, which {story}, unless that is planned, not measured"
        return LogFinding("error", channel, f"{story}: {channel} looks like {unit}. Set it in the channel map.", values)
    return LogFinding(
        "warning", name, f"{story}, which should be 1: a wrong unit or scale, or a car that slides?", values
    )
