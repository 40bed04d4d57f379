"""The common base of the readers: a log is a set of columns, each with its own time stamps and possibly a unit."""

from __future__ import annotations

import abc
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.channel_map import Channel
from jaxveh.io.decimals import decimal
from jaxveh.io.naming import check_known, listing
from jaxveh.io.toml import shorten
from jaxveh.io.units import convert, is_unit

TIME_NAMES = ("time", "timestamps", "timestamp", "t")
"""Names by which a time column is found, in this order and in any case."""

# `wheel[3]` is a name, `speed [km/h]` is a name and a unit.
_UNIT_IN_NAME = re.compile(r"^(?P<name>.*\S)\s*\[(?!\d+\])(?P<unit>[^\[\]]*)\]$")


class Column(NamedTuple):
    """One column of a log: `time` (n,) in seconds, `values` (n,), `unit` ("" if the file names none)."""

    time: np.ndarray
    values: np.ndarray
    unit: str


class Log(abc.ABC):
    """An open log: `path`, `note` (the file's note about its source, or ""), `names` of its columns without time."""

    path: Path
    note: str
    names: tuple[str, ...]
    as_saved: bool = False
    """Whether the file was saved from a recording, so that its channels keep their float types."""

    @abc.abstractmethod
    def column(self, name: str, group: int | None = None) -> Column:
        """Load one column; raise `InputError` for an unknown name, or cells that are not numbers."""

    def close(self) -> None:  # noqa: B027  most logs keep no file open
        """Close the file."""


class TableLog(Log):
    """A log whose columns share one time column: CSV and Parquet.

    `headings` are the names of the columns, `load` returns the cells of one; a name may have its unit in brackets
    (`yaw_rate [deg/s]`), unless `units` has it.
    """

    def __init__(
        self,
        path: Path,
        headings: Sequence[str],
        load: Callable[[str], object],
        units: Mapping[str, str],
        note: str,
        time: Channel | None,
    ):
        self.path, self.note, self._load = path, note, load
        plain = {h: (h, units[h]) if h in units else split_unit(h) for h in headings}
        self._heading = {name: heading for heading, (name, _) in plain.items()}
        self._units = dict(plain.values())
        if len(self._heading) < len(plain):
            raise InputError(f"{path}: several columns have the same name without their [unit]; rename them.")
        time_name = self._find_time(time)
        self.names = tuple(name for name in self._heading if name != time_name)
        stamps, unit = self._values(time_name), (time and time.unit) or self._units[time_name]
        if time is not None:
            stamps = apply(time, stamps)
        self._time = convert(stamps, unit, "s", f"{path}: {time_name}") if is_unit(unit) else stamps
        if self._time.size == 0:
            raise InputError(f"{path}: the log is empty: it has columns but no row.")

    def column(self, name: str, group: int | None = None) -> Column:
        name = self._plain(name)
        return Column(self._time, self._values(name), self._units[name])

    def _plain(self, name: str) -> str:
        """Return the name without unit of a column that may be given with its unit."""
        if name not in self._heading and name in self._heading.values():
            name = split_unit(name)[0]
        check_known(str(self.path), "column", name, self._heading, "Name the file's column in the channel map.")
        return name

    def _find_time(self, time: Channel | None) -> str:
        if time is not None:
            return self._plain(time.column)
        for wanted in TIME_NAMES:
            for name in (wanted, *self._heading):
                if name in self._heading and name.casefold() == wanted:
                    return name
        raise InputError(
            f"{self.path}: no time column ({', '.join(TIME_NAMES)}); {listing('time', self._heading)}. "
            'Name it in a channel map: time = "COLUMN".'
        )

    def _values(self, name: str) -> np.ndarray:
        return numeric(self._load(self._heading[name]), f"{self.path}: column {name!r}")


def split_unit(heading: str) -> tuple[str, str]:
    """`yaw_rate [deg/s]` as `("yaw_rate", "deg/s")`; a heading without brackets has the unit ""."""
    match = _UNIT_IN_NAME.match(heading)
    return (match["name"], match["unit"].strip()) if match else (heading.strip(), "")


def apply(channel: Channel, values: np.ndarray) -> np.ndarray:
    """Apply a channel map's sign, scale and offset to values (n,), which are unchanged with the default ones."""
    if channel.scale != 1.0 or channel.offset != 0.0:
        values = channel.scale * values + channel.offset
    return -values if channel.sign < 0 else values


def numeric(cells, what: str) -> np.ndarray:
    """Return cells as a float array (n,), empty ones as NaN; the error names the first row whose cell is not a number."""
    array = np.asarray(cells)
    if array.ndim == 1 and array.dtype.name == "bfloat16":
        return array
    if array.ndim != 1 or array.dtype.kind in "cV":
        raise InputError(
            f"{what}: contains {array.dtype} of shape {array.shape}, not one number per row. Leave it out."
        )
    if array.dtype.kind == "f":
        return array
    if array.dtype.kind in "iub":
        return array.astype(np.float64)
    if array.dtype.kind in "mM":
        raise InputError(f"{what}: contains dates, not numbers. Convert it to seconds first, or leave it out.")
    return np.array([_cell(cell, row, what) for row, cell in enumerate(array.tolist())], dtype=np.float64)


def _cell(cell, row: int, what: str) -> float:
    if cell is None:
        return np.nan
    try:
        return decimal(cell) if isinstance(cell, str) else float(cell)
    except (TypeError, ValueError, OverflowError) as error:
        comma = isinstance(cell, str) and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", cell)
        advice = (
            'Decimal commas: set decimal = "," under [csv] in the channel map.'
            if comma
            else "Correct the cell, or leave the column out by naming the others in a channel map."
        )
        raise InputError(f"{what}, data row {row + 1}: {shorten(cell)} is not a number. {advice}") from error
