"""`jaxveh check`: checks of a log before its data are used."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table
from rich.text import Text

from jaxveh import Recording, diagnostics, io
from jaxveh.cli import options
from jaxveh.cli.console import results
from jaxveh.cli.log_errors import COLOURS
from jaxveh.cli.output import check_report, make_folder, write_numbers
from jaxveh.cli.vehicle import car_of
from jaxveh.diagnostics import kit

ORDER = tuple(COLOURS)

WIDEST = 32
"""The greatest width of the channels' names beside their messages; some loggers write paths of sixty letters."""


def check(
    log: options.Log,
    vehicle: Annotated[
        Path | None,
        typer.Option(
            "--vehicle",
            metavar="CAR",
            help="The car, its file or a name; adds the checks that need a car (steering offset, signs).",
        ),
    ] = None,
    channels: options.Channels = None,
    out: options.Out = None,
    numbers: options.Numbers = None,
) -> None:
    """Check a log: signs, units, gaps, delays between channels, steering offset, plausibility.

    The findings are printed in words. Nothing is changed and nothing is fitted. The exit code is 0 even if errors are found.

    Example: [bold]jaxveh check drive.csv --vehicle car.toml --out check[/]
    """
    check_report(out, numbers)
    recording = io.read_recording(log, channels)
    car = None if vehicle is None else car_of(vehicle)
    findings = diagnostics.check_log(recording, car=car)
    _print(log, recording, findings)
    if out is not None:
        from jaxveh import plots

        make_folder(out)
        path = plots.save(plots.recording(recording), out / "channels.png")
        results().print(f"figure: {path}")
    found = [finding._asdict() for finding in findings]
    configuration = {"log": log, "vehicle": vehicle, "channels": channels}
    write_numbers(numbers, {"log": _summary(recording), "findings": found}, configuration, None)


def _summary(recording: Recording) -> dict:
    time = np.asarray(recording.time)
    return {
        "rows": len(recording),
        "start_s": time[0],
        "end_s": time[-1],
        "median_step_s": np.median(np.diff(time)) if len(recording) > 1 else None,
        "channels": {name: recording.unit(name) for name in recording.names},
    }


def _print(log: Path, recording: Recording, findings) -> None:
    console, about = results(), _summary(recording)
    step = "" if about["median_step_s"] is None else f", every {about['median_step_s']:.4g} s"
    rows, start, end = about["rows"], about["start_s"], about["end_s"]
    console.print(Text(log.name, "bold"), f"{rows} rows from {kit.shown_time(start, end)} s{step}")
    lines = Table.grid(padding=(0, 2))
    lines.add_column(justify="right")
    lines.add_column(overflow="fold", max_width=WIDEST)
    lines.add_column(overflow="fold")
    for severity in ORDER:
        for finding in findings:
            if finding.severity == severity:
                lines.add_row(Text(severity, COLOURS[severity]), Text(finding.channel), Text(finding.message))
    console.print(lines)
    counts = {s: sum(finding.severity == s for finding in findings) for s in ORDER}
    console.print(", ".join(f"{count} {name}" for name, count in counts.items()))
