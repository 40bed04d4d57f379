"""Racelogic's `.vbo`: text in sections, of a satellite receiver and of what is connected to it.

The format is Racelogic's "VBO file format": places in minutes, longitude positive to the west, time of day as HHMMSS.SS.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, warn
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.csv_layout import BLANKS, text_encoding
from jaxveh.io.csv_log import read_below
from jaxveh.io.geodesy import east_and_north, without_turns
from jaxveh.io.log import TableLog, numeric
from jaxveh.io.stamps import of_packed_clock
from jaxveh.io.units import convert
from jaxveh.io.vbo_head import standard_name, units_of, vbo_head

SATELLITES = 0x3F
"""The bits of `sats` with the number of satellites; the others are a brake trigger (64) and differential corrections (128)."""


def open_vbo(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a log of a VBOX.

    Its standard channels become `speed`, `course`, `z`, `climb_rate`, and `x` (east) and `y` (north) of the first fix, unless the
    file has columns of these names; they are NaN where `sats` says that there is no satellite. Time is in seconds since the
    midnight before. Other columns keep their names and units. A channel map can also name the file's own standard columns
    (`velocity`, `heading`), as they are in the file.

    **Raises** `InputError` for a file without its sections, or without a row.
    """
    encoding, _ = text_encoding(path, channels.encoding if channels else None)
    head = vbo_head(path, encoding)
    cells = read_below(path, head.columns, BLANKS, head.lines, encoding)
    if len(cells[head.columns[0]]) == 0:
        raise InputError(f"{path}: the log is empty: it has columns but no row.")
    standard = {standard_name(name): name for name in reversed(head.columns)}
    units = units_of(path, head, standard)
    if (time := standard.get("time")) is not None:
        cells[time] = of_packed_clock(cells[time])
    translated = _translated(path, cells, standard, units)
    made = {name: one for name, one in translated.items() if name not in cells}
    units |= {name: unit for name, (_, _, unit) in made.items()}
    columns = {**cells, **{name: values for name, (_, values, _) in made.items()}}
    log = TableLog(path, list(columns), columns.__getitem__, units, "", channels)
    # Also beside a column `course` of the file's own: its `heading` is not that of two antennas.
    replaced = {source for sources, _, _ in translated.values() for source in sources}
    log.names = tuple(name for name in log.names if name not in replaced)
    return log


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
        made["course"] = ((standard["heading"],), without_turns(seen(0.5 * np.pi - in_si("heading", "rad"))), "rad")
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
    warn(f"{path}: `sats` is 0 in all rows: it is not used, so that rows without a satellite are not found.")
    return ~there
