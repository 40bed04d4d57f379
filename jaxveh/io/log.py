"""The common base of the readers: a log is a set of columns, each with its own time stamps and possibly a unit."""

from __future__ import annotations

import abc
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.channel_map import Channel, ChannelMap
from jaxveh.io.decimals import decimal
from jaxveh.io.likely_names import MOST_LIKELY, likely_names, unit_of_ending
from jaxveh.io.naming import check_known, listing, split_unit
from jaxveh.io.repeats import without_repeats
from jaxveh.io.split_stamps import nanoseconds_of, split_stamps
from jaxveh.io.stamps import seconds
from jaxveh.io.toml import shorten
from jaxveh.io.units import convert, is_unit

TIME_NAMES = ("time", "timestamps", "timestamp", "t")
"""Names by which a time column is found, in this order and in any case."""

_SWAP = str.maketrans(",.", ".,")


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

    def column_over(self, name: str, time: Channel) -> Column:
        """Load one column over a time column of its own; only tables have such columns."""
        raise InputError(
            f"{self.path}: column {name!r}: time = {time.column!r}: only for CSV and Parquet; here each column has its time "
            "stamps. Leave it out of the channel map."
        )

    def close(self) -> None:  # noqa: B027  most logs keep no file open
        """Close the file."""


class TableLog(Log):
    """A log whose columns share one time column, or have one of their own: CSV and Parquet.

    `headings` are the names of the columns, `load` returns the cells of one; a name may have its unit in brackets
    (`yaw_rate [deg/s]`), unless `units` has it. `point` is the decimal sign of texts, `clock` the time column of a format that
    has always the same. A name that several columns have can be neither a known channel nor be loaded.
    """

    def __init__(
        self,
        path: Path,
        headings: Sequence[str],
        load: Callable[[str], object],
        units: Mapping[str, str],
        note: str,
        channels: ChannelMap | None,
        point: str = ".",
        clock: str = "",
    ):
        self.path, self.note, self._load, self._point = path, note, load, point
        self._repeats = channels.repeats if channels else None
        self._twice = {heading for heading in headings if headings.count(heading) > 1}
        plain = {h: (h, units[h]) if h in units else split_unit(h) for h in headings}
        shorts = [name for name, _ in plain.values()]
        alike = {name for name in shorts if shorts.count(name) > 1}
        told = sorted(name for name in alike if canonical_unit(name) is not None)
        if told and not (channels and channels.channels):
            raise InputError(
                f"{path}: several columns have the same name without their [unit], {told[0]!r}; rename them."
            )
        plain = {heading: (heading if name in alike else name, unit) for heading, (name, unit) in plain.items()}
        self._heading = {name: heading for heading, (name, _) in plain.items()}
        self._units = dict(plain.values())
        time = (channels.time if channels else None) or (Channel(clock) if clock else None)
        time_name = self._find_time(time) if channels is None or channels.shares_time else None
        part = None if time_name is None else nanoseconds_of(time_name, self._heading)
        self.names = tuple(name for name in self._heading if name not in (time_name, part))
        self._time = None if time_name is None else self._stamps(time_name, time)

    def column(self, name: str, group: int | None = None) -> Column:
        name = self._plain(name)
        assert self._time is not None
        return Column(self._time, self._values(name), self._units[name])

    def column_over(self, name: str, time: Channel) -> Column:
        """Load one column over a time column of its own, without the rows in which that is empty."""
        name, stamps = self._plain(name), self._stamps(self._plain(time.column), time)
        rows = np.isfinite(stamps)
        stamps, values = stamps[rows], self._values(name)[rows]
        # A row of what each device said last repeats samples.
        if (joined := without_repeats(stamps, {name: values}, self._repeats)) is not None:
            stamps, values = joined[0], joined[1][name]
        if np.any(np.diff(stamps) <= 0):
            k = int(np.argmax(np.diff(stamps) <= 0))
            raise InputError(
                f"{self.path}: column {time.column!r}: {stamps[k + 1]} s after {stamps[k]} s: the times of {name!r} must be "
                "strictly increasing."
            )
        return Column(stamps, values, self._units[name])

    def _plain(self, name: str) -> str:
        """Return the name without unit of a column that may be given with its unit."""
        if name not in self._heading and name in self._heading.values():
            name = next(plain for plain, heading in self._heading.items() if heading == name)
        check_known(str(self.path), "column", name, self._heading, "Name the file's column in the channel map.")
        return name

    def _find_time(self, time: Channel | None) -> str:
        if time is not None:
            return self._plain(time.column)
        for wanted in TIME_NAMES:
            for name in (wanted, *self._heading):
                if name in self._heading and name.casefold() == wanted:
                    return name
        pairs = split_stamps(self._heading)
        if len(pairs) == 1:
            return pairs[0][0]
        if pairs:
            shown = "; ".join(f"{seconds} and {part}" for seconds, part in pairs)
            raise InputError(
                f"{self.path}: several pairs of columns are seconds and nanoseconds of a time ({shown}). Name the seconds of "
                f'one in a channel map: time = "{pairs[0][0]}".'
            )
        alike = likely_names("time", self._heading)
        first = f" {', '.join(alike[:MOST_LIKELY])} may be it." if alike else ""
        raise InputError(
            f"{self.path}: no time column ({', '.join(TIME_NAMES)}); {listing('time', self._heading)}.{first} "
            'Name it in a channel map: time = "COLUMN", or time = { column = "COLUMN", unit = "ms" }.'
        )

    def _stamps(self, name: str, told: Channel | None) -> np.ndarray:
        """Return a time column in seconds; dates and times of day need no unit."""
        what = f"{self.path}: column {name!r}"
        stamps = seconds(self._cells(name), what)
        if stamps is not None:
            if told is not None and is_unit(told.unit) and told.unit != "s":
                raise InputError(f"{what}: unit {told.unit!r}, but it has dates or times of day; leave the unit out.")
            stamps = stamps if told is None else apply(told, stamps)
        else:
            unit = (told and told.unit) or self._units[name]
            if told is not None:
                check_ending(what, told, unit, "s")
            stamps = self._values(name) if told is None else apply(told, self._values(name))
            stamps = convert(stamps, unit, "s", f"{self.path}: {name}") if is_unit(unit) else stamps
            part = nanoseconds_of(name, self._heading)
            if part is not None and (told is None or (told.scale, told.offset) == (1.0, 0.0)):
                stamps = stamps + 1e-9 * self._values(part)
        if stamps.size == 0:
            raise InputError(f"{self.path}: the log is empty: it has columns but no row.")
        return stamps

    def _cells(self, name: str) -> object:
        if self._heading[name] in self._twice:
            heading = self._heading[name]
            own = [one for one in self._heading if one.startswith(f"{split_unit(heading)[0]} (column ")]
            said = f"name one in a channel map: {', '.join(own)}" if own else "rename them"
            raise InputError(f"{self.path}: several columns are named {heading!r}; {said}.")
        return self._load(self._heading[name])

    def _values(self, name: str) -> np.ndarray:
        return numeric(self._cells(name), f"{self.path}: column {name!r}", self._point)


def check_ending(what: str, channel: Channel, unit: str | None, target: str) -> None:
    """Raise `InputError` if nothing tells the unit of a column but its name, which ends with another one than `target`."""
    ending = unit_of_ending(channel.column, target)
    if not is_unit(unit) and channel.scale == 1.0 and ending not in ("", target):
        raise InputError(
            f"{what}: the name ends as if it were in {ending}, and no unit is given: it would count as {target}. "
            f'Add unit = "{ending}" to it in the channel map, or unit = "{target}".'
        )


def apply(channel: Channel, values: np.ndarray) -> np.ndarray:
    """Apply a channel map's sign, scale and offset to values (n,), which are unchanged with the default ones."""
    if channel.scale != 1.0 or channel.offset != 0.0:
        values = channel.scale * values + channel.offset
    return -values if channel.sign < 0 else values


def numeric(cells, what: str, point: str = ".") -> np.ndarray:
    """Return cells as a float array (n,), empty ones as NaN; the error names the first row whose cell is not a number.

    `point` is the decimal sign of texts.
    """
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
    return np.array([_cell(cell, row, what, point) for row, cell in enumerate(array.tolist())], dtype=np.float64)


def _cell(cell, row: int, what: str, point: str) -> float:
    if cell is None:
        return np.nan
    try:
        # With a decimal comma, a point would be one of thousands.
        swapped = cell.translate(_SWAP) if isinstance(cell, str) and point == "," else cell
        return decimal(swapped) if isinstance(swapped, str) else float(swapped)
    except (TypeError, ValueError, OverflowError) as error:
        comma = isinstance(cell, str) and point == "." and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", cell)
        advice = (
            'Decimal commas: set decimal = "," under [csv] in the channel map.'
            if comma
            else "Correct the cell, delete its row, or leave the column out by naming the others in a channel map."
        )
        raise InputError(f"{what}, data row {row + 1}: {shorten(cell)} is not a number. {advice}") from error
