"""The progress protocol: long work on the host reports to a callable; jaxveh itself prints nothing."""

from __future__ import annotations

from typing import Any, Protocol

from jaxveh._core.errors import check_callable


class Progress(Protocol):
    """Called with the work done so far, the total work, and a short description of the current stage."""

    def __call__(self, done: float, total: float, stage: str) -> None: ...


def silent(done: float, total: float, stage: str) -> None:
    """The default: report nothing."""


def check_progress(report: Any) -> None:
    """Raise `InputError` unless progress can be reported to it."""
    check_callable(
        "progress", report, "It is called with the work done, the total and a stage: lambda done, total, stage: ..."
    )


def part(report: Progress, first: float, last: float, name: str) -> Progress:
    """Return a callable for a part of the work, which is reported as the share from `first` to `last` of the whole."""
    return lambda done, total, stage: report(first + (last - first) * done / total, 1.0, f"{name}: {stage}")
