"""TYDEX files, the output of tyre test rigs.

The format is that of H.-J. Unrau and J. Zamow, TYDEX-Format, Description and Reference Manual, release 1.3 (1997): sections
that begin with `**NAME`, comment lines that begin with `!`, fixed columns for a name (10 characters), a description (30), a
unit (10) and values (10 each).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from jaxveh._core.errors import InputError, path_of
from jaxveh.io.decimals import decimal
from jaxveh.io.files import check_readable
from jaxveh.io.toml import shorten

MISSING = ("NOTAVAIL", "NAN")
"""Texts in the place of a number that was not measured."""

_NAME, _UNIT, _VALUES, _WIDTH = slice(0, 10), slice(40, 50), 50, 10


@dataclass(frozen=True, eq=False)
class TydexChannel:
    """One quantity of a TYDEX file: physical `values` (n,), or a float for a constant, in `unit`; its `line` from 1.

    A constant that is not a number (the name of a road) is a text.
    """

    name: str
    unit: str
    values: np.ndarray | float | str
    line: int


@dataclass(frozen=True, eq=False)
class TydexFile:
    """A TYDEX file: `header` and `comments` unchanged, `constants` and measured `channels` by name."""

    source: str
    header: dict[str, str]
    comments: tuple[str, ...]
    constants: dict[str, TydexChannel]
    channels: dict[str, TydexChannel]

    def find(self, name: str) -> TydexChannel | None:
        """Return the channel of that name, otherwise the constant; None if there is neither."""
        return self.channels.get(name, self.constants.get(name))


@dataclass(frozen=True)
class _Conversion:
    """`factor * (raw + before) + after`."""

    name: str
    unit: str
    factor: float
    before: float
    after: float
    line: int


def read_tydex(path: str | Path) -> TydexFile:
    """Read a TYDEX file; each channel is `factor (raw + offset of the raw value) + offset of the physical value`.

    **Raises** `InputError`, with the line, for a file without **MEASURCHANNELS or **MEASURDATA, or with several of the first; a
    channel that occurs twice, a row with another number of columns than there are channels, and a cell that is not a number
    (`NOTAVAIL` is a missing one).
    """
    path = path_of(path)
    check_readable(path)
    # Descriptions and comments may contain bytes that are not UTF-8 (a degree sign).
    return parse_tydex(path.read_text(encoding="utf-8", errors="replace"), str(path))


def parse_tydex(text: str, source: str = "TYDEX file") -> TydexFile:
    """Parse the text of a TYDEX file; see `read_tydex`."""
    sections = _sections(text)
    _check_one_measurement(text, source)
    for needed in ("MEASURCHANNELS", "MEASURDATA"):
        if not sections.get(needed):
            raise InputError(f"{source}: no section **{needed} with lines: there are no measurements in TYDEX format.")
    conversions = [_conversion(line, number, source) for number, line in sections["MEASURCHANNELS"]]
    _check_unique(conversions, source)
    rows = [_row(line, number, len(conversions), source) for number, line in sections["MEASURDATA"]]
    raw = np.array(rows)
    channels = {
        c.name: TydexChannel(c.name, c.unit, c.factor * (raw[:, k] + c.before) + c.after, c.line)
        for k, c in enumerate(conversions)
    }
    constants = {c.name: c for c in (_constant(line, number) for number, line in sections.get("CONSTANTS", []))}
    header = {line[_NAME].strip(): line[40:].strip() for _, line in sections.get("HEADER", [])}
    return TydexFile(source, header, tuple(line for _, line in sections.get("COMMENTS", [])), constants, channels)


def _check_one_measurement(text: str, source: str) -> None:
    lines = enumerate(text.splitlines(), start=1)
    counted = takewhile(lambda one: not one[1].upper().startswith("**END"), lines)
    begins = [k for k, line in counted if line.upper().startswith("**MEASURCHANNELS")]
    if len(begins) > 1:
        raise InputError(
            f"{source}: **MEASURCHANNELS is {len(begins)} times there, in lines {', '.join(map(str, begins))}: several "
            "measurements in one file. Write a file for each, with all sections above the first, and give them together."
        )


def _sections(text: str) -> dict[str, list[tuple[int, str]]]:
    """Return lines with their numbers by section, without blank lines, comment lines and lines after **END."""
    found: dict[str, list[tuple[int, str]]] = {}
    section = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("**"):
            section = line[2:].split(maxsplit=1)[0].upper() if line[2:].strip() else ""
            if section == "END":
                break
        elif section and line.strip() and not line.startswith("!"):
            found.setdefault(section, []).append((number, line.rstrip()))
    return found


def _conversion(line: str, number: int, source: str) -> _Conversion:
    name, unit = line[_NAME].strip(), line[_UNIT].strip()
    try:
        factors = [decimal(cell) for cell in _cells(line[_VALUES:], 3)]
    except ValueError:
        factors = [np.nan]
    if len(factors) > 3 or not np.isfinite(factors).all():
        raise InputError(
            f"{source}, line {number}: {name}: conversion {line[_VALUES:].strip()!r}: must be a factor and two offsets "
            "in columns 51, 61 and 71 (the name begins in column 1, the unit in column 41)."
        )
    factor, before, after = [*factors, *(1.0, 0.0, 0.0)[len(factors) :]]
    if factor == 0:
        raise InputError(f"{source}, line {number}: {name}: conversion factor 0: must be another number.")
    return _Conversion(name, unit, factor, before, after, number)


def _check_unique(conversions: list[_Conversion], source: str) -> None:
    first: dict[str, int] = {}
    for c in conversions:
        if c.name in first:
            raise InputError(
                f"{source}: channel {c.name} occurs twice, in lines {first[c.name]} and {c.line}: keep one."
            )
        first[c.name] = c.line


def _row(line: str, number: int, channels: int, source: str) -> list[float]:
    cells = _cells(line, channels)
    if len(cells) != channels:
        raise InputError(
            f"{source}, line {number}: {len(cells)} columns, but **MEASURCHANNELS names {channels} channels."
        )
    return [_number(cell, number, source) for cell in cells]


def _cells(text: str, wanted: int) -> list[str]:
    """Split a text into cells at blanks; if cells touch each other (`-1234.5678-1234.5678`), into cells of ten characters."""
    cells = text.split()
    if len(cells) >= wanted or len(text) <= _WIDTH * (wanted - 1):
        return cells
    return [text[k * _WIDTH : (k + 1) * _WIDTH].strip() for k in range(wanted)]


def _number(cell: str, line: int, source: str) -> float:
    if cell.upper() in MISSING:
        return np.nan
    try:
        return decimal(cell)
    except ValueError:
        raise InputError(
            f"{source}, line {line}: {shorten(cell)} is not a number (write {MISSING[0]} for a missing one)."
        ) from None


def _constant(line: str, number: int) -> TydexChannel:
    text = line[_VALUES:].strip()
    try:
        value: float | str = decimal(text)
    except ValueError:
        value = text
    return TydexChannel(line[_NAME].strip(), line[_UNIT].strip(), value, number)
