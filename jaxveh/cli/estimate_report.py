"""The page of `jaxveh estimate --report`."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import jaxveh
from jaxveh import InputError, Recording, io
from jaxveh.cli import sideslip
from jaxveh.cli.console import number, spread
from jaxveh.cli.drives import Drive
from jaxveh.cli.estimate_figures import beside
from jaxveh.cli.log_errors import COLOURS
from jaxveh.cli.output import check_product
from jaxveh.diagnostics import kit

BASELINE = "open_loop_"
WORDS = {
    "rmse": "RMSE",
    "constant": "mean error",
    "rmse_without_constant": "RMSE without the mean error",
    "worst": "largest error",
    "coverage_50": "share inside the 50 % band",
    "coverage_95": "share inside the 95 % band",
    "crps": "CRPS",
    "crps_constant": "CRPS with a constant standard deviation",
}
"""The fields of a `diagnostics.Score` in words."""


def check_report_page(path: Path | None, force: bool, sources: tuple[Path | None, ...]) -> None:
    """Raise `InputError`, before any work, if the page could not be written, or Bokeh is missing."""
    if path is not None:
        check_product(path, (".html",), force, sources, "--report")
        io.kit.require("bokeh", "writing a report", "report")


def reported_log(
    drive: Drive, found: Any, seen: Recording, truth: str | None, score: Mapping[str, Any] | None,
    car: io.CarSpecification, calibration: Any,
) -> Any:  # fmt: skip
    """Return a log for the page, with its estimate `found` of the rows of `seen`, and its score by the names of the JSON file."""
    from jaxveh import plots

    true, others = beside(car, seen, truth)
    try:
        axle = plots.rear_axle_points(calibration or car, found, seen, least_speed=sideslip.least_speed_of(car))
    except InputError:
        axle = None
    try:
        innovations = plots.innovation_points(found)
    except InputError:  # the filter has no innovations, or there are no measurements
        innovations = ()
    tables = () if score is None else (score_table(score),)
    return plots.ReportedLog(drive.log.name, found, seen, true, others, axle, innovations, tables)


def write_report(
    path: Path,
    logs: Sequence[Any],
    drives: Sequence[Drive],
    car: io.CarSpecification,
    calibration: Any,
    source: str,
    facts: Mapping[str, Any],
    *,
    overwrite: bool = False,
) -> None:
    """Write the page of `logs` (from `reported_log`), completely or not at all.

    `source`: the origin of the calibration, in words; `facts`: options by name, None for those that were not given.
    """
    from jaxveh import plots

    about = [("logs" if len(drives) > 1 else "log", "; ".join(_log_in_words(drive) for drive in drives))]
    about += [("car", _car_in_words(car)), ("calibration", source)]
    about += [(name, str(value)) for name, value in facts.items() if value is not None]
    about += [("command", shlex.join(["jaxveh", *sys.argv[1:]])), ("version", f"jaxveh {jaxveh.__version__}")]
    checked = [one for drive in drives for one in _findings(drive)]
    tables = [plots.ReportTable("", (), about), *checked, _fitted(calibration)]
    names = ", ".join(drive.log.name for drive in drives)
    io.write_text(plots.log_report(logs, title=f"Sideslip of {names}", tables=tables), path, overwrite=overwrite)


def _log_in_words(drive: Drive) -> str:
    time = np.asarray(drive.recording.time)
    return f"{drive.log} ({time.size} rows, {kit.shown_time(time[0], time[-1])} s)"


def _car_in_words(car: io.CarSpecification) -> str:
    name = f"{car.name}: " if car.name else ""
    return (
        f"{name}{car.mass:g} kg, {car.yaw_inertia:g} kg m², axles {car.front_axle_to_cg:g} and {car.rear_axle_to_cg:g} m from "
        "the centre of gravity"
    )


def _findings(drive: Drive) -> list[Any]:
    """Return the findings of `check`, the worst first; the checks that passed are folded."""
    from jaxveh import plots

    columns = "severity", "channel", "finding"
    worst_first = sorted(drive.findings, key=lambda finding: list(COLOURS).index(finding.severity))
    rows = [(finding.severity, finding.channel, finding.message) for finding in worst_first]
    told, fine = [row for row in rows if row[0] != "ok"], [row for row in rows if row[0] == "ok"]
    nothing = "" if told else "No findings."
    tables = [plots.ReportTable(f"Check of {drive.log.name}", columns, told, nothing)]
    return [*tables, plots.ReportTable(f"{len(fine)} checks passed", columns, fine, folded=True)] if fine else tables


def _fitted(calibration: Any) -> Any:
    from jaxveh import plots

    if calibration is None:
        return plots.ReportTable(
            "Fitted parameters", (), (), "Nothing was fitted: the values of the car file are used."
        )
    rows = [
        (name, *spread(one["value"], one["std"], "|").replace("± ", "").split("|"), one["unit"])
        for name, one in sideslip.fitted_parameters(calibration)["fitted"].items()
    ]
    rows = [row if len(row) == 4 else (row[0], row[1], "-", row[2]) for row in rows]
    return plots.ReportTable(
        "Fitted parameters", ("parameter", "value", "standard error", "unit"), rows, numbers=(1, 2)
    )


def score_table(score: Mapping[str, Any]) -> Any:
    """Return a table of the errors, from the names of the JSON file, beside those of the open-loop linear model."""
    from jaxveh import plots

    rows = [
        (_in_words(name), _shown(name, value), _shown(name, score.get(BASELINE + name)))
        for name, value in score.items()
        if name.startswith(("sideslip_", "v_y_"))
    ]
    count, floor = score["rows"], score["least_speed"]
    words = (
        f"Over the {count} rows that have a truth and at least {floor:g} m/s. Bands should contain 50 and 95 % of them."
    )
    return plots.ReportTable("Score against the truth", ("", "estimate", "open-loop linear model"), rows, words, (1, 2))


def _in_words(name: str) -> str:
    """Return `sideslip_rmse_deg` as `sideslip: RMSE [°]`."""
    what = "sideslip" if name.startswith("sideslip_") else "v_y"
    plain = name.removeprefix(f"{what}_").removesuffix("_deg")
    unit = "" if "coverage" in plain else " [°]" if what == "sideslip" else " [m/s]"
    return f"{what}: {WORDS.get(plain, plain.replace('_', ' '))}{unit}"


def _shown(name: str, value: Any) -> str:
    if value is None or not np.isfinite(value):
        return "–"
    return f"{100 * value:.1f} %" if "coverage" in name else number(value)
