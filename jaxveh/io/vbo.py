"""Racelogic's `.vbo`: text in sections, of a satellite receiver and of what is connected to it.

The format is Racelogic's "VBO file format": places in minutes, longitude positive to the west, time of day as HHMMSS.SS.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, JaxvehWarning
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.csv_layout import BLANKS, text_encoding
from jaxveh.io.csv_log import read_below
from jaxveh.io.geodesy import east_and_north
from jaxveh.io.log import TableLog, numeric
from jaxveh.io.stamps import after_midnight
from jaxveh.io.units import convert, is_unit_name

SATELLITES = 0x3F
"""The bits of `sats` with the number of satellites; the others are a brake trigger (64) and differential corrections (128)."""

ALIASES = {
    "satellites": "sats", "latitude": "lat", "longitude": "long", "lon": "long", "altitude": "height",
    "vertvel": "vertical_velocity", "vert_vel": "vertical_velocity", "verticalvelocity": "vertical_velocity",
}  # fmt: skip
"""Other names of the standard columns, in small letters and with `_` for `-`."""

UNITS = {"lat": "arcmin", "long": "arcmin", "heading": "deg", "height": "m", "time": "s"}
"""The units of standard columns that have always the same."""

SPEEDS = {"velocity": "km/h", "vertical_velocity": "km/h"}
"""The units of the others where their titles do not tell: older receivers had knots and m/s."""

HEAD = 10_000
"""The number of lines among which [data] must be: a car's networks have hundreds of channels, each named three times."""

IN_TITLES = {"kmh": "km/h", "kph": "km/h", "knots": "knot", "kts": "knot", "mph": "mph"}
"""Units as titles end with them, beside the usual ones."""


class Head(NamedTuple):
    """What is above the rows: `titles` and `columns`, the long and the short names; `units` of the last columns; the number of
    `lines`."""

    titles: list[str]
    columns: list[str]
    units: list[str]
    lines: int


def open_vbo(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a log of a VBOX.

    Its standard channels become `speed`, `course`, `z`, `climb_rate`, and `x` (east) and `y` (north) of the first fix, unless the
    file has columns of these names; they are NaN where `sats` says that there is no satellite. Time is in seconds since the
    midnight before. Other columns keep their names and units. A channel map can also name the file's own standard columns
    (`velocity`, `heading`), as they are in the file.

    **Raises** `InputError` for a file without its sections, or without a row.
    """
    encoding, _ = text_encoding(path, channels.encoding if channels else None)
    head = _head(path, encoding)
    cells = read_below(path, head.columns, BLANKS, head.lines, encoding)
    if len(cells[head.columns[0]]) == 0:
        raise InputError(f"{path}: the log is empty: it has columns but no row.")
    standard = {_standard(name): name for name in reversed(head.columns)}
    units = _units(path, head, standard)
    if (time := standard.get("time")) is not None:
        cells[time] = _of_day(cells[time], f"{path}: column {time!r}")
    translated = _translated(path, cells, standard, units)
    made = {name: one for name, one in translated.items() if name not in cells}
    units |= {name: unit for name, (_, _, unit) in made.items()}
    columns = {**cells, **{name: values for name, (_, values, _) in made.items()}}
    log = TableLog(path, list(columns), columns.__getitem__, units, "", channels)
    # Also beside a column `course` of the file's own: its `heading` is not that of two antennas.
    replaced = {source for sources, _, _ in translated.values() for source in sources}
    log.names = tuple(name for name in log.names if name not in replaced)
    return log


def _head(path: Path, encoding: str) -> Head:
    """Return the sections above the rows."""
    sections: dict[str, list[str]] = {}
    lines = 0
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        inside: list[str] = []
        for line in islice(file, HEAD):
            lines += 1
            if (found := re.fullmatch(r"\s*\[([^\[\]]+)\]\s*", line)) is not None:
                inside = sections.setdefault(found[1].strip().casefold(), [])
                if found[1].strip().casefold() == "data":
                    break
            else:
                inside.append(line.strip())
    lacking = [name for name in ("column names", "data") if name not in sections]
    if lacking:
        raise InputError(
            f"{path}: has no line [{lacking[0]}] among the first {HEAD}: it is no log of a VBOX. If it is a table of text, let "
            "its name end in .txt."
        )
    columns = " ".join(sections["column names"]).split()
    if len(set(columns)) < len(columns) or not columns:
        raise InputError(f"{path}: [column names]: {' '.join(columns) or 'none'}: must be names that differ.")
    titles = [line for line in sections.get("header", []) if line]
    units = sections.get("channel units", [])
    # A blank line ends the section; a channel without a unit has one, too.
    return Head(titles, columns, units[:-1] if units and not units[-1] else units, lines)


def _standard(column: str) -> str:
    plain = column.casefold().replace("-", "_")
    return ALIASES.get(plain, plain)


def _units(path: Path, head: Head, standard: dict[str, str]) -> dict[str, str]:
    """Return the units by column: those that the format sets, those of [channel units], and those with which titles end."""
    own = {standard[name] for name in (*UNITS, *SPEEDS) if name in standard}
    titled = dict(zip(head.columns, map(_unit_of_title, head.titles), strict=True)) if _titled(head) else {}
    told = dict(zip(head.columns[-len(head.units) :], head.units, strict=False)) if any(head.units) else {}
    if len(head.units) > len(head.columns) or any(told.get(name) for name in own):
        warnings.warn(
            f"{path}: [channel units] has {len(head.units)} lines, which are not those of the last columns: they are not used. "
            "Give units in a channel map.",
            JaxvehWarning,
            stacklevel=3,
        )
        told = {}
    fixed = {standard[name]: unit for name, unit in UNITS.items() if name in standard}
    assumed = {standard[name]: unit for name, unit in SPEEDS.items() if name in standard}
    found = {**assumed, **{n: u for n, u in titled.items() if u}, **{n: u for n, u in told.items() if u}, **fixed}
    return found


def _titled(head: Head) -> bool:
    return len(head.titles) == len(head.columns)


def _unit_of_title(title: str) -> str:
    """Return the unit with which a title such as `velocity kmh` ends, or ""."""
    last = title.split()[-1].strip("()[]")
    unit = IN_TITLES.get(last.casefold(), last)
    return unit if len(title.split()) > 1 and is_unit_name(unit) else ""


def _of_day(cells: Any, what: str) -> Any:
    """Return times of day, HHMMSS.SS, as seconds, which go on after midnight; texts such as 10:05:03.1 as they are."""
    if np.asarray(cells).dtype.kind not in "fiu":
        return cells
    hours, rest = np.divmod(numeric(cells, what), 10_000.0)
    minutes, seconds = np.divmod(rest, 100.0)
    # The remainder of a number of six digits has lost six of its own.
    return after_midnight(np.round(3600.0 * hours + 60.0 * minutes + seconds, 6))


def _translated(
    path: Path, cells: dict[str, Any], standard: dict[str, str], units: dict[str, str]
) -> dict[str, tuple[Sequence[str], np.ndarray, str]]:
    """Return what the standard columns say in the names and axes of the package: from which columns, values, unit."""
    number = lambda name: numeric(cells[standard[name]], f"{path}: column {standard[name]!r}").astype(np.float64)
    in_si = lambda name, unit: convert(number(name), units[standard[name]], unit, f"{path}: column {standard[name]!r}")
    fixed = _fixed(path, number("sats")) if "sats" in standard else True
    seen = lambda values: np.where(fixed, values, np.nan)
    made = {}
    for name, ours, unit in (
        ("velocity", "speed", "m/s"),
        ("height", "z", "m"),
        ("vertical_velocity", "climb_rate", "m/s"),
    ):
        if name in standard:
            made[ours] = ((standard[name],), seen(in_si(name, unit)), unit)
    if "heading" in standard:
        # Clockwise from north; ours is counterclockwise from east.
        made["course"] = ((standard["heading"],), _unwrapped(seen(0.5 * np.pi - in_si("heading", "rad"))), "rad")
    if "lat" in standard and "long" in standard:
        places = (standard["lat"], standard["long"])
        east, north = east_and_north(seen(in_si("lat", "rad")), seen(-in_si("long", "rad")))
        made |= {"x": (places, east, "m"), "y": (places, north, "m")}
    return made


def _fixed(path: Path, sats: np.ndarray) -> np.ndarray:
    """Return whether there is a satellite, (n,); where no row has one, the file does not count them, and all rows are taken."""
    there = (np.nan_to_num(sats).astype(int) & SATELLITES) > 0
    if there.any():
        return there
    warnings.warn(
        f"{path}: `sats` is 0 in all rows: it is not used, so that rows without a satellite are not found.",
        JaxvehWarning,
        stacklevel=4,
    )
    return ~there


def _unwrapped(angles: np.ndarray) -> np.ndarray:
    """Return angles (n,) without steps of a whole turn, also across missing ones."""
    known = np.isfinite(angles)
    found = np.full(angles.shape, np.nan)
    found[known] = np.unwrap(angles[known])
    return found
