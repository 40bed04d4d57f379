"""Check of the names: a channel that is not known by its name is hardly checked, and no estimator uses it."""

from __future__ import annotations

import re

from jaxveh.diagnostics.log_findings import LogFinding, LogView
from jaxveh.io import CANONICAL, kit

USUAL = ("v_x", "yaw_rate", "a_y", "steer")
"""The channels that the checks and the estimators of sideslip compare."""


SPEEDS = ("wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr")
"""The channels from which a missing v_x is estimated."""

WITH = "(--channels), with its unit and sign"
"""The end of the advice to name a column."""

INSTEAD = {"v_x": ("speed", "wheel_speed_fl", "wheel_speed_rl"), "steer": ("steering_wheel", "steer_fl", "steer_left")}
"""Channels from which the programs find another one: their names are enough."""


def check_names(log: LogView) -> list[LogFinding]:
    """Report channels whose names look like known ones, and a log without any known channel."""
    findings = []
    plain = {_plain(name): name for name in CANONICAL}
    for name in log.channels:
        meant = plain.get(_plain(name))
        if name not in CANONICAL and meant is not None and meant not in log.channels:
            message = (
                f"is not used: the name of this channel is {meant}. Rename it, or name it in a channel map {WITH}."
            )
            findings.append(LogFinding("warning" if meant in USUAL else "note", name, message, {}))
    told = {finding.channel for finding in findings}
    for wanted in USUAL if "v_x" in log.channels else (*USUAL, *SPEEDS):
        alike = [name for name in kit.likely_names(wanted, log.channels) if name not in told]
        there = any(name in log.channels for name in (wanted, *INSTEAD.get(wanted, ())))
        if alike and not there and not told & set(kit.likely_names(wanted, log.channels)):
            findings.append(_likely(wanted, alike))
    if not findings and not any(name in CANONICAL for name in log.channels):
        known = ", ".join(USUAL)
        message = (
            f"none of the log's channels has a known name ({known}, ...), so little is checked: use a channel map."
        )
        findings.append(LogFinding("warning", "names", message, {}))
    return findings


def _likely(wanted: str, alike: list[str]) -> LogFinding:
    """The finding that a channel is not there, while others look like it."""
    meant = "steer, or steering_wheel if it is the angle of the steering wheel" if wanted == "steer" else wanted
    message = f"may be {meant}, which is not there under that name, and is not used: name it in a channel map {WITH}."
    return LogFinding("warning" if wanted in USUAL else "note", ", ".join(alike[: kit.MOST_LIKELY]), message, {})


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).casefold()
