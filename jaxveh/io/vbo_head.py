"""What is above the rows of a VBOX's log: sections with the names, titles and units of its columns."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from jaxveh._core.errors import InputError, warn
from jaxveh.io.units import is_unit_name

ALIASES = {
    "satellites": "sats", "latitude": "lat", "longitude": "long", "lon": "long", "lng": "long", "altitude": "height",
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


def vbo_head(path: Path, encoding: str) -> Head:
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
    titles = titles if len(titles) == len(columns) else []
    units = sections.get("channel units", [])
    # A blank line ends the section; a channel without a unit has one, too.
    return Head(titles, columns, units[:-1] if units and not units[-1] else units, lines)


def standard_name(column: str) -> str:
    """Return the first of a standard column's names; of another column its own, in small letters and with `_` for `-`."""
    plain = column.casefold().replace("-", "_")
    return ALIASES.get(plain, plain)


def units_of(path: Path, head: Head, standard: dict[str, str]) -> dict[str, str]:
    """Return the units by column: those that the format sets, those of [channel units], and those with which titles end."""
    of = lambda table: {standard[name]: unit for name, unit in table.items() if name in standard}
    fixed, assumed = of(UNITS), of(SPEEDS)
    titled = dict(zip(head.columns, map(_unit_of_title, head.titles), strict=False))
    told = dict(zip(head.columns[-len(head.units) :], head.units, strict=False)) if any(head.units) else {}
    if len(head.units) > len(head.columns) or any(told.get(name) for name in (*fixed, *assumed)):
        warn(
            f"{path}: [channel units] has {len(head.units)} lines, which are not those of the last columns: they are not used. "
            "Give units in a channel map."
        )
        told = {}
    return {**assumed, **{n: u for n, u in titled.items() if u}, **{n: u for n, u in told.items() if u}, **fixed}


def _unit_of_title(title: str) -> str:
    """Return the unit with which a title such as `velocity kmh` ends, or ""."""
    last = title.split()[-1].strip("()[]")
    unit = IN_TITLES.get(last.casefold(), last)
    return unit if len(title.split()) > 1 and is_unit_name(unit) else ""
