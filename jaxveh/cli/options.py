"""Options that several programs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from jaxveh import InputError
from jaxveh._core.errors import LARGEST_SEED
from jaxveh.diagnostics import kit

LOG_HELP = (
    "The log: .csv (.txt, .tsv, .dat, .log), .parquet, .nc, .mf4, .mdf, .mat, .mcap or .vbo, with a time column and channels "
    "(jaxveh schema channels)."
)

Log = Annotated[Path, typer.Argument(metavar="LOG", help=LOG_HELP, show_default=False)]

Logs = Annotated[list[Path], typer.Argument(metavar="LOG...", help=LOG_HELP, show_default=False)]

CAR_HELP = "its file (jaxveh schema car), or a name (jaxveh simulate --list)"

VehicleFile = Annotated[
    Path, typer.Option("--vehicle", metavar="CAR", help=f"The car: {CAR_HELP}.", show_default=False)
]

Channels = Annotated[
    Path | None,
    typer.Option(
        "--channels", metavar="MAP.toml", help="Map columns to channels, with unit and sign (jaxveh schema channels)."
    ),
]

Numbers = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Write every number shown, with a manifest; an old file is replaced."),
]

Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Write figures into this folder; old ones of the same names are replaced."
    ),
]

Force = Annotated[bool, typer.Option("--force", help="Let -o replace an existing file.")]

Seed = Annotated[
    int,
    typer.Option(
        "--seed", help="Seed of the random numbers; the same seed gives the same result.", min=0, max=LARGEST_SEED
    ),
]

Calibrate = Annotated[
    str | None,
    typer.Option(
        "--calibrate",
        metavar="START:END",
        help="First fit the rear axle, noises and sensor offsets on this span, in seconds of the log's time. Either end may be "
        "omitted (150: or :287.5).",
    ),
]

Span = Annotated[
    str | None,
    typer.Option(
        "--span",
        metavar="START:END",
        help="Use only this part of each log, in seconds of its own time. Either end may be omitted (150: or :287.5).",
    ),
]

Anyway = Annotated[bool, typer.Option("--anyway", help="Continue although the check of a log finds errors.")]

CalibrateOn = Annotated[
    list[str] | None,
    typer.Option(
        "--calibrate-on",
        metavar="CHANNEL",
        help="A reference channel that the calibration may use inside its span: v_y or sideslip. Repeatable.",
    ),
]

Fill = Annotated[
    float | None,
    typer.Option(
        "--fill",
        metavar="SECONDS",
        help="Fill gaps (NaN) in inputs (steer, v_x, a_x, torques) by linear interpolation, at the ends by the nearest "
        "sample, up to this length; otherwise a gap is an error.",
    ),
]


def span_of(text: str | None, start: float, end: float, option: str = "--calibrate") -> tuple[float, float] | None:
    """Read START:END, the value of an `option`, in seconds of a log that runs from `start` to `end`; None if `text` is None.

    Raises `InputError` if the text is no span, or the span lies outside the log.
    """
    if text is None:
        return None
    left, colon, right = text.partition(":")
    try:
        first = float(left) if left.strip() else start
        # Only rows strictly before the end count: an open end must lie beyond the last row.
        last = float(right) if right.strip() else float("inf")
    except ValueError:
        first = last = float("nan")
    if not colon or not first < last:
        raise InputError(
            f"{option} {text}: must be START:END in seconds with START before END, such as "
            f"{kit.shown_time(start)}:{kit.shown_time((start + end) / 2)}."
        )
    if first > end or last <= start:
        raise InputError(f"{option} {text}: lies outside the log, which runs from {kit.shown_time(start, end)} s.")
    return first, last
