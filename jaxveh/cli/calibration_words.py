"""The origin of an estimate's numbers in words: a calibration, and what it was fitted to."""

from __future__ import annotations

from typing import Any

from jaxveh.cli import sideslip
from jaxveh.cli.console import results, spread, table
from jaxveh.diagnostics import kit


def print_fitted(calibration: Any) -> None:
    """Print the fitted parameters as a table."""
    rows = [
        (name, spread(one["value"], one["std"]), one["unit"])
        for name, one in sideslip.fitted_parameters(calibration)["fitted"].items()
    ]
    table("Fitted", ("parameter", "value ± std", "unit"), rows)
    if (words := sideslip.untold_in_words(calibration)) is not None:
        results().print(words)


def say_source(choice: Any, calibration: Any, reason: str | None, count: int) -> None:
    """Print the origin of the numbers of `count` logs, and the fitted parameters."""
    if calibration is None or choice.calibrate is None:
        results().print(source_in_words(choice, calibration, reason, count), markup=False)
    if calibration is None or choice.calibration is not None:
        return
    print_fitted(calibration)
    if (words := sideslip.reference_in_words(calibration, choice.calibrate_on)) is not None:
        results().print(words)


def source_in_words(choice: Any, calibration: Any, reason: str | None, count: int) -> str:
    """Return the origin of the numbers of `count` logs."""
    if calibration is None:
        return f"Nothing was calibrated, the values of the car file are used: {reason}."
    spans = "; ".join(f"{one.log or 'a log'} {kit.shown_time(one.start, one.end)} s" for one in calibration.spans)
    if choice.calibration is not None:
        return f"Calibrated by {choice.calibration}, on {spans}."
    if choice.calibrate is not None:
        return f"Calibrated on {spans}."
    one = "The log calibrated itself, on all its", "The logs calibrated themselves together, on all their"
    return f"{one[count > 1]} rows and without a reference."
