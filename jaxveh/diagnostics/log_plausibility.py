"""Checks of the plausibility of accelerations, and of the numbers in a car file."""

from __future__ import annotations

import numpy as np

from jaxveh.diagnostics.log_findings import GRAVITY, LogFinding, LogView
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io

FRICTION = 1.3
"""Largest lateral acceleration over gravity of tyres without downforce, racing tyres included."""

_STIFFNESS = (4.0, 60.0)  # cornering stiffness of an axle over its load, 1/rad
_INERTIA = (0.4, 2.0)  # yaw inertia over mass a b


def check_plausibility(log: LogView) -> list[LogFinding]:
    """Check whether tyres can carry the accelerations, and cars can have the stiffnesses and the inertia."""
    findings = []
    for name in ("a_y", "a_x"):
        if log.has(name):
            findings.append(_grip(log, name))
    return findings + (check_car(log.car) if log.car is not None else [])


def check_car(car: CarSpecification) -> list[LogFinding]:
    """Check whether stiffnesses over axle loads and the inertia over mass a b are plausible for a car."""
    io.check_car_file("check_car", car)
    findings = []
    for axle, stiffness, arm in (
        ("front", float(car.front_cornering_stiffness or 0), car.rear_axle_to_cg),
        ("rear", float(car.rear_cornering_stiffness or 0), car.front_axle_to_cg),
    ):
        load = car.mass * GRAVITY * arm / car.wheelbase
        unit = " N/deg instead of N/rad, or one wheel instead of two?"
        findings.append(
            _ratio(f"{axle}_cornering_stiffness", stiffness / load, _STIFFNESS, "the axle's load per radian", unit)
        )
    inertia = car.yaw_inertia / (car.mass * car.front_axle_to_cg * car.rear_axle_to_cg)
    findings.append(_ratio("yaw_inertia", inertia, _INERTIA, "mass times both axle distances", ""))
    return findings


def _grip(log: LogView, name: str) -> LogFinding:
    smooth = log.smooth(log.even(name), 0.3)
    known = np.abs(smooth[np.isfinite(smooth)])
    peak = float(np.quantile(known, 0.999)) / GRAVITY if known.size else 0.0
    words = f"reaches {peak:.2f} g for a third of a second"
    if peak > FRICTION:
        message = f"{words}: more than tyres carry without downforce. A wrong unit or scale?"
        return LogFinding("warning", name, message, {"peak": peak})
    return LogFinding("ok", name, f"{words}.", {"peak": peak})


def _ratio(name: str, ratio: float, allowed: tuple[float, float], other: str, hint: str) -> LogFinding:
    low, high = allowed
    if low <= ratio <= high:
        return LogFinding("ok", name, f"is {ratio:.3g} times {other}.", {"ratio": ratio})
    message = f"is {ratio:.3g} times {other}; cars have {low:g} to {high:g}.{hint}"
    return LogFinding("warning", name, message, {"ratio": ratio})
