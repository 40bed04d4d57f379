"""The progress protocol: long host-side work reports to a callable; jaxveh itself prints nothing."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called with the work done so far, the work in all, and a short description of the current stage."""

    def __call__(self, done: float, total: float, stage: str) -> None: ...


def silent(done: float, total: float, stage: str) -> None:
    """The default: says nothing."""


def part(report: Progress, first: float, last: float, name: str) -> Progress:
    """The progress of a part of the work, told as the share from `first` to `last` of the whole."""
    return lambda done, total, stage: report(first + (last - first) * done / total, 1.0, f"{name}: {stage}")
