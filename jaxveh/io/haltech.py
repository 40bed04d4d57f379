"""CSV of Haltech's NSP: the channels are named one below the other above the rows, which hold whole numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jaxveh._core.errors import InputError, warn
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.csv_layout import text_encoding
from jaxveh.io.log import TableLog
from jaxveh.io.optional import require

MARK = "%DataLog%"
"""The first line."""

SCALES = {
    "Speed": (0.1, "km/h"), "Acceleration": (1e-3, "g"), "AngularVelocity": (0.1, "deg/s"), "Angle": (0.1, "deg"),
    "EngineSpeed": (1.0, "rpm"), "Percentage": (0.1, "%"), "BatteryVoltage": (1e-3, "V"),
}  # fmt: skip
"""The size of a step and its unit, by the type of a channel, as programs that read these files take them; Haltech publishes
none."""

NO_READING = 2_147_480_000
"""A number of this size or more stands for a missing value: the largest that 32 bits hold."""

MOST = 8
"""The number of channels without a unit that the warning names."""


def is_haltech(path: Path) -> bool:
    """Whether a text file begins as those of NSP do."""
    with path.open("rb") as file:
        return file.read(64).lstrip(b"\xef\xbb\xbf").startswith(MARK.encode())


def open_haltech(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a log of NSP; a `JaxvehWarning` says what its numbers were taken for.

    **Raises** `InputError` for a file without channels or rows, and rows with another number of cells.
    """
    encoding, _ = text_encoding(path, channels.encoding if channels else None)
    names, types, above = _head(path, encoding)
    pandas = require("pandas", "reading CSV")
    try:
        with path.open(encoding=encoding, newline="") as file:
            frame = pandas.read_csv(file, skiprows=above, header=None, index_col=False, low_memory=False)
    except (pandas.errors.EmptyDataError, pandas.errors.ParserError) as error:
        raise InputError(
            f"{path}: its rows cannot be read ({str(error).strip()}). Export it from NSP again."
        ) from error
    if frame.shape[1] != len(names) + 1:
        raise InputError(
            f"{path}: its rows have {frame.shape[1]} cells, expected {len(names) + 1}: a time, and one for each channel. Export "
            "it from NSP again."
        )
    scales = {name: SCALES.get(kind, (1.0, "")) for name, kind in zip(names, types, strict=True)}
    unknown = [f"{name} ({kind})" for name, kind in zip(names, types, strict=True) if kind not in SCALES]
    left = f"; as in the file, without a unit: {', '.join(unknown[:MOST])}" + ", ..." * (len(unknown) > MOST)
    warn(
        f"{path}: the steps of its whole numbers are those in common use for their types (a speed: 0.1 km/h): compare one with a "
        f"value that you know{left if unknown else ''}."
    )
    places = {"time": 0, **{name: k for k, name in enumerate(names, start=1)}}

    def load(heading: str) -> np.ndarray:
        cells = frame.iloc[:, places[heading]].to_numpy()
        if heading == "time" or cells.dtype.kind not in "fiu":
            return cells
        numbers = cells.astype(np.float64)
        return np.where(np.abs(numbers) >= NO_READING, np.nan, numbers * scales[heading][0])

    return TableLog(path, ["time", *names], load, {name: unit for name, (_, unit) in scales.items()}, "", channels)


def _head(path: Path, encoding: str) -> tuple[list[str], list[str], int]:
    """Return the names and the types of the channels, and the number of lines above the rows."""
    names: list[str] = []
    types: list[str] = []
    above, rows = 0, False
    with path.open(encoding=encoding) as file:
        for line in file:
            if rows := line[:1].isdigit():
                break
            above += 1
            key, _, value = (part.strip() for part in line.partition(":"))
            if key == "Channel":
                names.append(value)
                types.append("Raw")
            elif key == "Type" and names:
                types[-1] = value
    if not names or not rows:
        raise InputError(f"{path}: begins as a log of Haltech's NSP, but has no channel or no row. Export it again.")
    return names, types, above
