"""Check of the names: a channel that is not known by its name is hardly checked, and no estimator uses it."""

from __future__ import annotations

import re

from jaxveh.diagnostics.log_findings import LogFinding, LogView
from jaxveh.io import CANONICAL

USUAL = ("v_x", "yaw_rate", "a_y", "steer")
"""The channels that the checks and the estimators of sideslip compare."""


def check_names(log: LogView) -> list[LogFinding]:
    """Report channels whose names differ from a known one only in capitals and signs, and a log without any known channel."""
    findings = []
    plain = {_plain(name): name for name in CANONICAL}
    for name in log.channels:
        meant = plain.get(_plain(name))
        if name not in CANONICAL and meant is not None and meant not in log.channels:
            message = f"is not used: the name of this channel is {meant}. Rename it, or name it in a channel map (--channels)."
            findings.append(LogFinding("warning" if meant in USUAL else "note", name, message, {}))
    if not findings and not any(name in CANONICAL for name in log.channels):
        known = ", ".join(USUAL)
        message = (
            f"none of the log's channels has a known name ({known}, ...), so little is checked: use a channel map."
        )
        findings.append(LogFinding("warning", "names", message, {}))
    return findings


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).casefold()
