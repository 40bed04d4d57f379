"""Options that several programs share, said once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from jaxveh import InputError

LOG_HELP = (
    "The log: .csv, .parquet, .nc, .mf4, .mdf, .mat or .mcap, with a time column and channels (jaxveh schema channels)."
)

Log = Annotated[Path, typer.Argument(metavar="LOG", help=LOG_HELP, show_default=False)]

Logs = Annotated[list[Path], typer.Argument(metavar="LOG...", help=LOG_HELP, show_default=False)]

VehicleFile = Annotated[
    Path, typer.Option("--vehicle", metavar="CAR.toml", help="The car (jaxveh schema car).", show_default=False)
]

Channels = Annotated[
    Path | None,
    typer.Option(
        "--channels", metavar="MAP.toml", help="Which column is which channel, unit and sign (jaxveh schema channels)."
    ),
]

Numbers = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write every number shown, with a manifest.")
]

Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Write figures into this folder.")]

Force = Annotated[bool, typer.Option("--force", help="Let -o replace an existing file.")]

Seed = Annotated[
    int, typer.Option("--seed", help="Of the random numbers; the same seed gives the same numbers.", min=0)
]

Calibrate = Annotated[
    str | None,
    typer.Option(
        "--calibrate",
        metavar="START:END",
        help="Fit the rear axle, noises and sensor offsets on this span first, in seconds of the log's time; either end may be "
        "left out (150: or :287.5).",
    ),
]

Span = Annotated[
    str | None,
    typer.Option(
        "--span",
        metavar="START:END",
        help="Take this part of each log alone, in seconds of its own time; either end may be left out (150: or :287.5).",
    ),
]

Anyway = Annotated[bool, typer.Option("--anyway", help="Go on where the check of a log finds errors.")]

CalibrateOn = Annotated[
    list[str] | None,
    typer.Option(
        "--calibrate-on",
        metavar="CHANNEL",
        help="A channel that the calibration may use inside its span besides the blind ones: v_y or sideslip.",
    ),
]

Fill = Annotated[
    float | None,
    typer.Option(
        "--fill",
        metavar="SECONDS",
        help="Fill gaps (NaN) of steer, v_x and a_x along lines, over at most so long; without it a gap there is an error.",
    ),
]


def span_of(text: str | None, start: float, end: float, option: str = "--calibrate") -> tuple[float, float] | None:
    """START:END, as an `option` gives it, as seconds of a log that runs from `start` to `end`; None where there is none.

    Raises `InputError` for what is no span, or lies outside the log.
    """
    if text is None:
        return None
    left, colon, right = text.partition(":")
    try:
        first = float(left) if left.strip() else start
        # Rows strictly before the end count, so that an open end must lie beyond the last.
        last = float(right) if right.strip() else float("inf")
    except ValueError:
        first = last = float("nan")
    if not colon or not first < last:
        raise InputError(
            f"{option} {text}: must be START:END in seconds with START before END, such as {start:g}:{(start + end) / 2:g}."
        )
    if first > end or last <= start:
        raise InputError(f"{option} {text}: lies outside the log, which runs from {start:g} to {end:g} s.")
    return first, last
