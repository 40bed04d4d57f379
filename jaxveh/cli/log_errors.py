"""Errors that the check of a log finds: they stop what reads the channel, and are a note to what does not."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
from rich.text import Text

from jaxveh import InputError, Recording
from jaxveh.cli.console import results
from jaxveh.cli.missing_speed import sources_of_speed
from jaxveh.diagnostics import LogFinding
from jaxveh.io import CarSpecification

COLOURS = {"error": "bold red", "warning": "yellow", "note": "cyan", "ok": "green"}


def tell(log: Path, findings: Sequence[LogFinding], read: Collection[str]) -> None:
    """Print the errors and warnings of a log; an error in channels that nothing asked for will `read` is a note."""
    for severity in ("error", "warning"):
        for one in findings:
            if one.severity == severity:
                unread = severity == "error" and not one.suspects & {*read, "time"}
                shown, more = ("note", " (An error, but nothing here reads it.)") if unread else (severity, "")
                words = f" {log.name}: {one.channel} {one.message}{more}"
                results().print(Text.assemble((shown, COLOURS[shown]), words), soft_wrap=True)


def check_trusted(log: Path, findings: Sequence[LogFinding], used: Collection[str]) -> None:
    """Raise `InputError` if there is an error in the time or in a channel that is `used`."""
    errors = [one for one in findings if one.severity == "error" and one.suspects & {*used, "time"}]
    if errors:
        first = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise InputError(
            f"{log}: {first.channel} {first.message}{more} `jaxveh check` shows all findings; --anyway uses the log unchanged."
        )


def read_by(quantity: ModuleType, name: str, car: CarSpecification, seen: Recording) -> set[str]:
    """Return the channels of the log that a method of a quantity reads, with the sources of a `v_x` that is not measured. An
    optional channel without any value is not read."""
    with contextlib.suppress(InputError):  # a car without a method's numbers is told of by the method
        # Without the channels that only move measurements to the centre of gravity.
        needs = quantity.METHODS[name].of_centre(car).needs
        empty = {one.channel for one in needs if one.optional and _is_empty(seen, one.channel)}
        read = {one.channel for one in needs} - empty
        return (read & set(seen.names)) | (sources_of_speed(seen, car) if "v_x" in read else set())
    return set()


def _is_empty(recording: Recording, name: str) -> bool:
    return name in recording and bool(np.isnan(np.asarray(recording[name])).all())
