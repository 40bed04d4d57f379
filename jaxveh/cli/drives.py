"""Logs as the programs of sideslip take them: read, cut to a span, looked at before anything is made of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.text import Text

from jaxveh import InputError, Recording, diagnostics, io
from jaxveh.cli import options
from jaxveh.cli.blanking import SEEN, fill_gaps
from jaxveh.cli.console import results
from jaxveh.io import CarSpecification

COLOURS = {"error": "bold red", "warning": "yellow", "note": "cyan", "ok": "green"}


class Drive(NamedTuple):
    """A log's file, what of it is taken, and what `check` says of that."""

    log: Path
    recording: Recording
    findings: Sequence[diagnostics.LogFinding] = ()


def read_drives(
    logs: list[Path],
    car: CarSpecification,
    channels: Path | None,
    fill: float | None,
    span: str | None,
    used: tuple[str | None, ...],
    anyway: bool,
) -> list[Drive]:
    """The logs, each cut to its span, with gaps of inputs filled on request, after `check` has looked at it.

    What `check` warns of is printed. **Raises** `InputError` where it finds errors in channels that are `used`, or seen by an
    estimator, unless it goes on `anyway`.
    """
    drives = []
    for log in logs:
        recording = io.read_recording(log, channels)
        wanted = options.span_of(span, float(recording.time[0]), float(recording.time[-1]), "--span")
        recording = fill_gaps(recording if wanted is None else recording.between(*wanted), fill)
        findings = _look_at(log, recording, car, {*SEEN, "time", *(name for name in used if name)}, anyway)
        drives.append(Drive(log, recording, findings))
    return drives


def _look_at(
    log: Path, recording: Recording, car: CarSpecification, used: set[str], anyway: bool
) -> Sequence[diagnostics.LogFinding]:
    findings = diagnostics.check_log(recording, car=car)
    told = [finding for finding in findings if finding.severity in ("error", "warning")]
    for severity in ("error", "warning"):
        for finding in told:
            if finding.severity == severity:
                line = Text.assemble((severity, COLOURS[severity]), f" {log.name}: {finding.channel} {finding.message}")
                results().print(line, soft_wrap=True)
    errors = [finding for finding in told if finding.severity == "error" and used & set(finding.channel.split(", "))]
    if errors and not anyway:
        first = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise InputError(
            f"{log}: {first.channel} {first.message}{more} `jaxveh check` tells all; --anyway goes on with the log as it is."
        )
    return findings
