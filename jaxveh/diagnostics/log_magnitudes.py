"""Checks of magnitudes: what no car reaches in SI units was recorded in another unit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh.diagnostics.log_findings import GRAVITY, LogFinding, LogView


class Limit(NamedTuple):
    """The largest magnitude `size` that a car reaches, the `unit` in words, the `likely` unit of a larger one; `sure`, if most
    estimates use the channel."""

    size: float
    unit: str
    likely: str
    sure: bool = True


def _wheels(name: str, *limit) -> dict[str, Limit]:
    return {f"{name}_{at}": Limit(*limit) for at in ("fl", "fr", "rl", "rr")}


_ANGLE, _TILT = Limit(1.6, "rad", "degrees"), Limit(1.0, "rad", "degrees", False)
_SPEED, _RATE = Limit(120.0, "m/s", "km/h or mph"), Limit(4.0, "rad/s", "deg/s")
_ACCELERATION = Limit(60.0, "m/s^2", "another unit")
_STEER = Limit(1.2, "rad at the road wheels", "degrees, or the angle of the steering wheel")
_FORCE, _TORQUE = Limit(3e5, "N", "another unit", False), Limit(3e5, "N m", "another unit", False)

LIMITS = {
    **dict.fromkeys(("v_x", "v_y", "speed"), _SPEED),
    "climb_rate": Limit(25.0, "m/s", "km/h or feet a minute", False),
    "sideslip": _ANGLE,
    # Slip angles of a wheel that stands, or of a car that spins, are any.
    **dict.fromkeys(("lane_heading", "slip_angle_front", "slip_angle_rear"), _ANGLE._replace(sure=False)),
    **dict.fromkeys(("roll", "pitch", "grade", "bank"), _TILT),
    **dict.fromkeys(("yaw_rate", "roll_rate", "pitch_rate"), _RATE),
    **dict.fromkeys(("a_x", "a_y"), _ACCELERATION),
    "a_z": Limit(100.0, "m/s^2", "another unit", False),
    **dict.fromkeys(("steer", "steer_rear", "steer_left", "steer_right"), _STEER),
    **_wheels("steer", *_STEER),
    "steering_wheel": Limit(25.0, "rad", "degrees"),
    "steering_wheel_rate": Limit(60.0, "rad/s", "deg/s", False),
    "steering_torque": Limit(300.0, "N m", "another unit", False),
    **_wheels("omega", 600.0, "rad/s", "revolutions per minute, or deg/s", False),
    **_wheels("wheel_speed", 150.0, "m/s", "km/h, mph, or a rotation in rad/s"),
    **_wheels("load", *_FORCE),
    **_wheels("torque", *_TORQUE),
    "throttle": Limit(1.5, "a share", "per cent", False),
    "brake_pressure": Limit(1e8, "Pa", "another unit", False),
    **dict.fromkeys(("drive_torque", "brake_torque"), _TORQUE),
    "friction": Limit(3.0, "a share", "per cent", False),
    **dict.fromkeys(("F_yf", "F_yr"), _FORCE),
}
"""What no car reaches (99.5 % quantile of the magnitude, so that spikes do not count), by channel."""

UNLIMITED = ("time", "yaw", "course", "heading", "lane_offset", "x", "y", "z")
"""Channels of any magnitude: angles that count turns, places, the time."""

UNSIGNED = ("speed", "throttle", "brake_pressure", "friction", *_wheels("load", *_FORCE))
"""Channels that are never negative."""

NEGATIVE = 0.02
"""Share of the largest magnitude below zero that is taken for an offset or noise of a sensor."""

WEAK_BRAKES = 5e3
"""A twentieth of a bar, Pa: a brake that works reaches more."""


FAR = 2.0
"""How many times the largest other sample a value is that stands for a missing one."""


def check_units(log: LogView) -> list[LogFinding]:
    """Check every known channel for magnitudes that no car reaches in SI units, and for negative magnitudes."""
    findings = []
    for name, limit in LIMITS.items():
        if log.has(name):
            values = _judged(log, name)
            if not values.size:
                continue
            found = _size(name, float(np.quantile(np.abs(values), 0.995)), limit)
            findings.append(_placeholder(values, limit, found) if found.severity != "ok" else found)
            findings += _negative(name, values) if name in UNSIGNED else []
    return findings


def check_gravity(log: LogView) -> list[LogFinding]:
    """Check the sign and the unit of the vertical accelerometer, whose usual value is gravity, positive."""
    if not log.has("a_z"):
        return []
    usual = float(np.nanmedian(log.channels["a_z"]))
    found = lambda severity, message: [LogFinding(severity, "a_z", message, {"usual": usual})]
    if usual < -0.5:
        return found("warning", f"is {usual:.3g} most of the time: z is up. Set sign = -1 in the channel map.")
    if 0.8 < usual < 1.25:
        return found("warning", f"is {usual:.3g} most of the time: it looks like g. Set the unit in the channel map.")
    if abs(usual / GRAVITY - 1.0) < 0.1:
        return found("ok", f"is {usual:.3g} m/s^2 most of the time.")
    return found("note", f"is {usual:.3g} m/s^2 most of the time, not {GRAVITY:g}: was gravity subtracted?")


def _judged(log: LogView, name: str) -> np.ndarray:
    """The finite samples of a channel; of the sideslip angle those while the car moves, since it is any angle at standstill."""
    moving = name == "sideslip" and log.has("v_x")
    values = log.while_moving(log.even(name)) if moving else log.channels[name]
    return values[np.isfinite(values)]


def _size(name: str, size: float, limit: Limit) -> LogFinding:
    values = {"size": size, "limit": limit.size}
    advice = "Set the unit in the channel map."
    severity = "error" if limit.sure else "warning"
    if size > limit.size:
        message = f"reaches {size:.4g}: too much for {limit.unit}; it looks like {limit.likely}. {advice}"
        return LogFinding(severity, name, message, values)
    if name == "brake_pressure" and 0.0 < size < WEAK_BRAKES:
        message = f"reaches {size:.4g}: too little for {limit.unit}; it looks like kPa, bar or MPa. {advice}"
        return LogFinding(severity, name, message, values)
    return LogFinding("ok", name, f"reaches {size:.4g} ({limit.unit}).", values)


def _placeholder(values: np.ndarray, limit: Limit, found: LogFinding) -> LogFinding:
    """Return the finding that one value beyond the limit stands for missing ones, if it is the only one; otherwise `found`."""
    beyond = np.abs(values) > limit.size
    others = np.abs(values[~beyond])
    if (
        not others.size
        or beyond.sum() < 2
        or np.ptp(values[beyond]) > 0.0
        or abs(values[beyond][0]) < FAR * others.max()
    ):
        return found
    value, count = float(values[beyond][0]), int(beyond.sum())
    otherwise = f"and reaches {others.max():.4g} otherwise"
    message = f"is {value:g} in {count} samples {otherwise}: does that stand for no value? Set it to NaN."
    return found._replace(message=message, values={**found.values, "placeholder": value, "count": float(count)})


def _negative(name: str, values: np.ndarray) -> list[LogFinding]:
    low = values < -NEGATIVE * np.max(np.abs(values))
    if not low.any():
        return []
    what = "A speed with a sign is v_x." if name == "speed" else "Set those to NaN."
    message = (
        f"is negative in {low.sum()} of {low.size} samples, down to {values.min():.4g}, and is a magnitude. {what}"
    )
    return [LogFinding("warning", name, message, {"count": float(low.sum()), "least": float(values.min())})]
