"""CSV through pandas: each cell is read as its exact decimal value, and files are written so that they read back the same."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, warn
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.csv_layout import BLANKS, COMMENT, Layout, find_layout, with_numbers
from jaxveh.io.haltech import is_haltech, open_haltech
from jaxveh.io.log import TableLog
from jaxveh.io.naming import split_unit
from jaxveh.io.optional import require
from jaxveh.io.units import is_unit, same_unit

MISSING = ["-", "--", "---", "#NV", "n.a."]
"""Cells without a value, beside those that pandas knows (empty, NA, NaN, null, #N/A, ...)."""


def open_csv(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a text file with columns: names, perhaps a line of units, and rows; see `csv_layout.find_layout`.

    The channel map gives what is not to be searched for. What was assumed is told in a `JaxvehWarning`. Of several columns
    with one name, each can be loaded with its number, such as `speed (column 14)`.
    """
    if is_haltech(path):
        return open_haltech(path, channels)
    table = read_columns(path, channels)
    more = [one for one in with_numbers(table.headings) if one not in table.headings]
    headings = [*table.headings, *more]
    log = TableLog(path, headings, table.cells.__getitem__, table.units, "", channels, table.point, table.clock)
    log.names = tuple(name for name in log.names if name not in {split_unit(one)[0] for one in more})
    return log


class TextTable(NamedTuple):
    """The columns of a text file: `headings`, `cells` by heading, `units` of a line of units by heading, the decimal `point`, and
    `clock`, the heading of the time or "" where the format does not tell."""

    headings: list[str]
    cells: dict[str, Any]
    units: dict[str, str]
    point: str
    clock: str = ""


def read_columns(path: Path, told: ChannelMap | None = None) -> TextTable:
    """Return the columns of a text file; it needs no time column. What was assumed is told in a `JaxvehWarning`."""
    layout = find_layout(path, told)
    frame = _read(path, layout, "strict")
    # Spreadsheets write rows of separators alone.
    frame = frame.dropna(how="all") if frame.iloc[:, 0].isna().any() else frame
    frame, remarks = _without_comments(path, layout, frame)
    if frame.empty:
        raise InputError(f"{path}: the log is empty: it has columns but no row.")
    if remarks := (*layout.remarks, *remarks):
        warn(f"{path}: {'; '.join(remarks)}.")
    headings = _named(layout.headings, frame)
    _tell_short_rows(path, layout, headings, frame, "strict")
    # The index that pandas writes has no name.
    headings = [heading or f"column {k}" for k, heading in enumerate(headings, start=1)]
    cells = _cells(with_numbers(headings), frame) | _cells(headings, frame)
    return TextTable(headings, cells, layout.units, layout.decimal, layout.clock)


def _without_comments(path: Path, layout: Layout, frame: Any) -> tuple[Any, Sequence[str]]:
    """Return the rows without comments among them, with a remark; raise `InputError` if the names are there again."""
    first = frame.iloc[:, 0]
    if first.dtype.kind in "fiub":
        return frame, ()
    texts = first.astype(str).str.strip()
    # The names of a RaceCapture go on with units.
    repeated = (texts == layout.headings[0]) | texts.str.startswith(f"{layout.headings[0]}|")
    if (again := np.flatnonzero(repeated)).size:
        raise InputError(
            f"{path}: data row {again[0] + 1} holds the names of the columns again: several drives in one file? Split it there."
        )
    # A car named #78 has a row of its own.
    comments = (texts.str.startswith(COMMENT) & (frame.iloc[:, 1:].isna().mean(axis=1) >= 0.5)).to_numpy(bool)
    count = int(comments.sum())
    return (
        (frame[~comments], (f"{count} line{'s' * (count > 1)} of comments among the rows",)) if count else (frame, ())
    )


def read_below(
    path: Path, headings: list[str], separator: str, lines: int, encoding: str = "utf-8-sig"
) -> dict[str, Any]:
    """Return the cells of each column, by heading, below `lines` header lines; bytes of another encoding are replaced."""
    layout = Layout(headings, {}, lines, separator, ".", encoding, ())
    frame = _read(path, layout, "replace")
    named = _named(headings, frame)
    _tell_short_rows(path, layout, named, frame, "replace")
    return _cells(named, frame)


def _tell_short_rows(path: Path, layout: Layout, headings: Sequence[str], frame: Any, errors: str) -> None:
    """Warn of rows with fewer cells than there are names: pandas fills them up with NaN, also those of a file that was cut."""
    if not frame.iloc[:, len(headings) - 1].isna().any():
        return
    with path.open(encoding=layout.encoding, errors=errors, newline=None) as file:
        rows = ((k, line) for k, line in enumerate(file, 1) if k > layout.first and line.strip())
        counts = ((k, _count(line, layout.separator)) for k, line in rows if not line.startswith(COMMENT))
        short = {k: count for k, count in counts if count < len(headings)}
    if not short:
        return
    lacking = ", ".join(headings[min(short.values()) :])
    one = len(short) == 1
    warn(
        f"{path}: {len(short)} {'row has' if one else 'rows have'} fewer cells than there are names ({len(headings)}), "
        f"{'in' if one else 'first in'} line {min(short)}: the rest is NaN, in {lacking}. Was the file cut?"
    )


def _count(line: str, separator: str) -> int:
    """Return the number of cells of a line. Separators within quotes are counted as well: no row looks shorter than it is."""
    return len(line.split()) if separator == BLANKS else line.count(separator) + 1


def _named(headings: list[str], frame: Any) -> list[str]:
    """Return the headings without a last one that is empty: a separator ends every line."""
    return headings[:-1] if headings[-1] == "" and frame.iloc[:, -1].isna().all() else headings


def _cells(headings: list[str], frame: Any) -> dict[str, Any]:
    return {heading: frame.iloc[:, column].array for column, heading in enumerate(headings)}


def write_csv(
    path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str], note: str
) -> None:
    """Write one header line, then every float in the shortest form that reads back as the same float64; NaN is an empty cell.

    The format has no place for units and note: they are dropped (see `io.with_units_in_names`). A known channel in
    another unit than SI would be read back wrongly, so it raises `InputError`.
    """
    for name in columns:
        wanted = canonical_unit(name)
        if wanted is not None and is_unit(units.get(name)) and not same_unit(units[name], wanted):
            raise InputError(
                f"{name} is in {units[name]!r}, not in {wanted!r}, and CSV has no place for units. Convert it first, write "
                "Parquet or MDF4, or put units in the names (io.with_units_in_names)."
            )
    pandas = require("pandas", "writing CSV")
    # The shortest form of a float32 would read back as another float64.
    wide = {name: np.asarray(values, dtype=np.float64) for name, values in {"time": time, **columns}.items()}
    pandas.DataFrame(wide).to_csv(path, index=False, lineterminator="\n", encoding="utf-8")


def _exact(version: str) -> dict[str, str]:
    """Return the option that makes pandas read each decimal as its nearest float64; since 3.1 pandas always does."""
    major, minor = map(int, version.split(".")[:2])
    return {} if (major, minor) >= (3, 1) else {"float_precision": "round_trip"}


def _read(path: Path, layout: Layout, errors: str):
    pandas = require("pandas", "reading CSV")
    above = layout.first
    try:
        with warnings.catch_warnings(), path.open(encoding=layout.encoding, errors=errors, newline="") as file:
            # Without this, rows longer than the header would lose cells with only a warning.
            warnings.simplefilter("error", pandas.errors.ParserWarning)
            # pandas itself would search the lines above for quotes.
            for _ in range(above):
                file.readline()
            return pandas.read_csv(
                file,
                sep=layout.separator,
                decimal=layout.decimal,
                header=None,
                names=range(len(layout.headings)),
                index_col=False,
                skipinitialspace=True,
                na_values=MISSING,
                **_exact(pandas.__version__),
                low_memory=False,
            )
    except pandas.errors.EmptyDataError as error:
        raise InputError(f"{path}: the log is empty: it has columns but no row.") from error
    except pandas.errors.ParserError as error:
        found = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
        names = f"the number of names ({len(layout.headings)}) that were found in line {max(above, 1)} or above"
        words = f"line {int(found[2]) + above} has {found[3]} cells, more than {names}" if found else str(error).strip()
        raise InputError(
            f"{path}: {words}. Correct the line, or give `names_line` and `separator` under [csv] in the channel map; names must "
            "be in one line."
        ) from error
    except pandas.errors.ParserWarning as error:
        raise InputError(
            f"{path}: rows have more cells than line {max(above, 1)} has names ({len(layout.headings)}). Correct that line, or "
            "give `names_line` and `separator` under [csv] in the channel map."
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not text in {layout.encoding} (byte {error.start}); save it as CSV in UTF-8."
        ) from error
