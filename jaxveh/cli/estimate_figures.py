"""The figures of `jaxveh estimate --out`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxveh import InputError, Recording
from jaxveh.cli import sideslip
from jaxveh.cli.console import results
from jaxveh.cli.output import make_folder
from jaxveh.estimators import open_loop_of_file
from jaxveh.io import CarSpecification

OPEN_LOOP = "open-loop linear model"


def beside(car: CarSpecification, seen: Recording, truth: str | None) -> tuple[Any, Mapping[str, Any]]:
    """Return the truth by name (None if there is none), and the curves beside it: the baseline, if there are truth and steer."""
    if truth is None:
        return None, {}
    baseline = open_loop_of_file(car, seen)
    return sideslip.truth_of(car, seen, truth), {} if baseline is None else {OPEN_LOOP: baseline}


def draw(
    found: Any,
    recording: Recording,
    seen: Recording,
    truth: str | None,
    car: CarSpecification,
    calibration: Any,
    span: tuple[float, float] | None,
    out: Path,
) -> list[Path]:
    """Draw figures into the folder `out` and print their names: channels, estimate, its worst part, innovations, rear axle.

    `found`: the estimate of the rows of `seen`; `recording`: the whole log, with the calibration `span` (s) too;
    `calibration`: None if the values of the car file are used.
    """
    from jaxveh import plots

    make_folder(out)
    true, others = beside(car, seen, truth)
    slow = sideslip.least_speed_of(car)
    spans = [] if span is None else [(max(span[0], float(recording.time[0])), span[1], "calibration")]
    errors = true is not None
    figures = {
        "channels": lambda: plots.recording(recording, spans=spans),
        "estimate": lambda: plots.estimate(found, true, ("sideslip",), others=others, errors=errors),
        "v_y": lambda: plots.estimate(found, true, ("v_y",), others=others, errors=errors),
        "worst": lambda: plots.closeup(found, seen, true, others=others, least_speed=slow),
        "innovations": lambda: plots.innovations(found),
        "rear_axle": lambda: plots.rear_axle(calibration or car, found, seen, least_speed=slow),
    }
    paths = []
    for name, make in figures.items():
        try:
            paths.append(plots.save(make(), out / f"{name}.png"))
            results().print(f"figure: {paths[-1]}", markup=False)
        except InputError as error:  # a log may have no row for one of the figures
            results().print(f"no figure {name}.png: {error}", markup=False, soft_wrap=True)
    return paths
