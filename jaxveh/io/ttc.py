"""Rig data in the format of the Formula SAE Tire Test Consortium (FSAE TTC), as Calspan's flat-belt machine writes them.

Text (`.dat`, `.csv`, `.txt`): a line about the test, a line of names, a line of units, then rows, separated by tabs. MATLAB's
`.mat`: a vector for each name, and a struct `channel` with `name` and `units`. The names are the consortium's:
`SA` and `IA` (deg) slip and inclination angle, `SL` the slip ratio to the effective radius, `FX`, `FY`, `FZ` (N), `MX`, `MZ`
(N m), `P` (kPa), `V` (km/h); in US customary units lb, ft-lb, psi, mph. Axes are SAE's, so that FZ of a loaded wheel is negative.
What the columns mean: E. M. Kasprzak and D. Gentz, The Formula SAE Tire Test Consortium, Tire Testing and Data Handling,
SAE 2006-01-3606.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, path_of, warn
from jaxveh.io.csv_log import read_below
from jaxveh.io.decimals import is_number
from jaxveh.io.files import check_readable
from jaxveh.io.log import numeric
from jaxveh.io.mat_file import read_mat
from jaxveh.io.naming import listing, split_unit

SUFFIXES = (".dat", ".txt", ".mat")
"""Endings of files that are read as the consortium's; a `.csv` is too if it has the consortium's names."""

LBF, FOOT, INCH = 4.4482216152605, 0.3048, 0.0254

UNITS = {
    "angle": {"deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180, "rad": 1.0},
    "ratio": {"none": 1.0, "-": 1.0, "": 1.0, "1": 1.0, "unitless": 1.0, "%": 0.01},
    "force": {"n": 1.0, "kn": 1e3, "lb": LBF, "lbs": LBF, "lbf": LBF},
    "moment": {"n-m": 1.0, "nm": 1.0, "n*m": 1.0, "n m": 1.0, "ft-lb": LBF * FOOT, "lb-ft": LBF * FOOT, "in-lb": LBF * INCH},
    "pressure": {"kpa": 1e3, "pa": 1.0, "bar": 1e5, "psi": LBF / INCH**2},
    "speed": {"kph": 1 / 3.6, "km/h": 1 / 3.6, "kmh": 1 / 3.6, "m/s": 1.0, "mph": 0.44704},
    "number": {},
}  # fmt: skip
"""Units by quantity, in any case, and their size in SI."""

METRIC = {
    "angle": "deg",
    "ratio": "none",
    "force": "n",
    "moment": "n-m",
    "pressure": "kpa",
    "speed": "kph",
    "number": "",
}
"""The units of a file that names none: the consortium's metric ones."""

COLUMNS = {
    "slip_angle": ("SA", "angle"),
    "slip_ratio": ("SL", "ratio"),
    "load": ("FZ", "force"),
    "camber": ("IA", "angle"),
    "speed": ("V", "speed"),
    "pressure": ("P", "pressure"),
    "F_x": ("FX", "force"),
    "F_y": ("FY", "force"),
    "M_x": ("MX", "moment"),
    "M_y": ("MY", "moment"),
    "M_z": ("MZ", "moment"),
    "run": ("RUN", "number"),
}
"""Fields of a `RigTable`, with the name of their column and its quantity."""

HEADER_LINES = 10
"""The line of names must be among this many first lines."""

FREE = 0.03
"""Largest variation of SR (2nd to 98th percentile) of a freely rolling wheel."""


class TtcTable(NamedTuple):
    """A file of the consortium.

    `columns`: (n,) by field of a `RigTable`, in SI units and with the signs of the file; `title`: its first line or the tyre's
    name; `source`: its path.
    """

    columns: dict[str, np.ndarray]
    title: str
    source: str


class _Cells(NamedTuple):
    """The columns of a file.

    `load`: functions that return the values (n,), by name in capitals; `units`: the units, for columns that have one.
    """

    load: dict[str, Callable[[], np.ndarray]]
    units: dict[str, str]
    title: str


def is_ttc(names: Iterable[str]) -> bool:
    """Whether these are the consortium's names: a load `FZ` and a slip `SA` or `SL`, in any case, with or without a unit."""
    known = {split_unit(name)[0].upper() for name in names}
    return "FZ" in known and not known.isdisjoint(("SA", "SL"))


def names_line(path: Path) -> tuple[int, list[str], str] | None:
    """Find the line with the consortium's names in a text file: its number from 0, the names, their separator; None if absent."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        for number, line in zip(range(HEADER_LINES), file, strict=False):
            splitter = max(("\t", ",", ";"), key=line.count)
            cells = _split(line, splitter if splitter in line else r"\s+")
            if is_ttc(cells):
                return number, cells, splitter if splitter in line else r"\s+"
    return None


def read_ttc(path: str | Path) -> TtcTable:
    """Read a file of the consortium: text, or a MATLAB file.

    The file's own units are used, and the consortium's metric units if it names none, with a `JaxvehWarning`. A missing slip is
    taken as zero. `SR` is not used as slip ratio: it refers to the loaded radius, so that it is not zero in free rolling.

    **Raises** `InputError`, naming the file and the column, for a file without `FZ`, or with neither `SA` nor `SL`; for
    unknown units, cells that are not numbers, columns of different lengths, and an `SR` that is swept without an `SL`.
    """
    path = path_of(path)
    check_readable(path)
    cells = _matlab(path) if path.suffix.lower() == ".mat" else _text(path)
    if not is_ttc(cells.load):
        raise InputError(f"{path}: FZ and one of SA, SL are needed among its columns; {listing('FZ', cells.load)}.")
    columns = {
        field: _in_si(cells, name, quantity, path) for field, (name, quantity) in COLUMNS.items() if name in cells.load
    }
    lengths = {COLUMNS[field][0]: len(values) for field, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{path}: columns of different lengths: {lengths}.")
    if "slip_ratio" not in columns and "SR" in cells.load:
        _refuse_swept(cells.load["SR"](), path)
    if not cells.units:
        told = ", ".join(
            f"{quantity} {unit}" for quantity, unit in METRIC.items() if quantity not in ("ratio", "number")
        )
        words = f"{path}: names no units; those of the consortium's metric files are assumed: {told}."
        warn(words)
    zero = np.zeros(len(columns["load"]))
    return TtcTable({"slip_angle": zero, "slip_ratio": zero, **columns}, cells.title, str(path))


def _in_si(cells: _Cells, name: str, quantity: str, path: Path) -> np.ndarray:
    values = cells.load[name]()
    if quantity == "number":
        return values
    unit, known = cells.units.get(name, METRIC[quantity]).strip(), UNITS[quantity]
    if unit.casefold() not in known:
        units = ", ".join(one or "nothing" for one in known)
        raise InputError(f"{path}: {name}: unit {unit!r}: must be one of {units}, in any case.")
    return values * known[unit.casefold()]


def _refuse_swept(ratio: np.ndarray, path: Path) -> None:
    low, high = np.nanpercentile(ratio, [2, 98])
    if high - low > FREE:
        raise InputError(
            f"{path}: no SL, and SR goes from {low:.3g} to {high:.3g}: SR refers to the loaded radius, so it is not the slip "
            "ratio; compute SL = RE N / V - 1 (RE in m, N in rad/s, V in m/s)."
        )


def _split(line: str, separator: str) -> list[str]:
    if separator == r"\s+":
        return line.split()
    cells = next(csv.reader([line.rstrip("\r\n")], delimiter=separator), [])
    return [cell.strip() for cell in cells]


def _text(path: Path) -> _Cells:
    found = names_line(path)
    if found is None:
        raise InputError(
            f"{path}: no line with the names FZ and SA or SL among the first {HEADER_LINES}: this is not a file of "
            "the FSAE TTC."
        )
    number, headings, separator = found
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = [line for line, _ in zip(file, range(number + 2), strict=False)]
    below = _split(lines[number + 1], separator) if len(lines) > number + 1 else []
    # A line of data may have an empty cell, and a line of units may name the unit of a ratio 1.
    rows_begin = sum(map(is_number, below)) > len(below) / 2
    units = {} if rows_begin else dict(zip((heading.upper() for heading in headings), below, strict=False))
    _check_unique(headings, path)
    cells = read_below(path, headings, separator, number + 1 + bool(units))
    named = {split_unit(heading): heading for heading in cells}
    units |= {name.upper(): unit for name, unit in named if unit}
    load = {
        name.upper(): lambda heading=heading: numeric(cells[heading], f"{path}: column {heading!r}")
        for (name, _), heading in named.items()
    }
    return _Cells(load, units, lines[0].strip() if number else "")


def _check_unique(headings: list[str], path: Path) -> None:
    names = [split_unit(heading)[0].upper() for heading in headings if heading]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{path}: several columns are named {', '.join(twice)}; rename them.")


def _matlab(path: Path) -> _Cells:
    found = read_mat(path)
    channel = found.get("channel")
    told = channel if isinstance(channel, dict) else {}
    names, units = _strings(told.get("name", ())), _strings(told.get("units", ()))
    vectors = {name: value for name, value in found.items() if isinstance(value, np.ndarray)}
    load = {name.upper(): lambda name=name: _vector(vectors[name], name, path) for name in vectors}
    title = found.get("tireid", "")
    return _Cells(load, dict(zip(map(str.upper, names), units, strict=False)), title if isinstance(title, str) else "")


def _strings(cells: Any) -> list[str]:
    """Return the texts of a MATLAB cell array of any nesting."""
    if isinstance(cells, list | tuple):
        return [text for cell in cells for text in _strings(cell)]
    return [cells] if isinstance(cells, str) else []


def _vector(values: np.ndarray, name: str, path: Path) -> np.ndarray:
    if max(values.shape, default=0) != values.size or values.dtype.kind not in "fiu":
        raise InputError(f"{path}: {name}: must be a vector of numbers, but is {values.dtype} of shape {values.shape}.")
    return values.ravel().astype(np.float64)
