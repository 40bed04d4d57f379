"""CSV through pandas: each cell is read as its exact decimal value, and files are written so that they read back the same."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.decimals import is_number
from jaxveh.io.log import TableLog
from jaxveh.io.optional import require
from jaxveh.io.units import is_unit, same_unit

_ENCODING = "utf-8-sig"


def open_csv(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a CSV file with one header line; the channel map gives the separator and the decimal sign.

    Without a map the separator is the most frequent of `,`, `;` and tab in the header line, and the decimal sign is a point.
    """
    headings, separator = _header(path, channels.separator if channels else None)
    columns = _columns(path, headings, separator, channels.decimal if channels else ".")
    return TableLog(path, tuple(columns), columns.__getitem__, {}, "", channels.time if channels else None)


def read_columns(path: Path) -> dict[str, Any]:
    """Return the cells of each column, by heading, of a CSV file with one header line; it needs no time column."""
    headings, separator = _header(path, None)
    return _columns(path, headings, separator, ".")


def read_below(path: Path, headings: list[str], separator: str, lines: int) -> dict[str, Any]:
    """Return the cells of each column, by heading, below `lines` header lines; bytes that are not UTF-8 are replaced."""
    return _columns(path, headings, separator, ".", lines, "replace")


def _columns(
    path: Path, headings: list[str], separator: str, decimal: str, lines: int = 1, errors: str = "strict"
) -> dict[str, Any]:
    frame = _read(path, headings, separator, decimal, lines, errors)
    # A separator at the end of every line makes a last column without a name and without cells.
    if headings[-1] == "" and frame.iloc[:, -1].isna().all():
        headings = headings[:-1]
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


def _header(path: Path, separator: str | None) -> tuple[list[str], str]:
    try:
        with path.open(encoding=_ENCODING, newline="") as file:
            line = file.readline()
            separator = separator or max(",;\t", key=line.count)
            file.seek(0)
            headings = [heading.strip() for heading in next(csv.reader(file, delimiter=separator))]
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start}); save it as CSV in UTF-8.") from error
    except csv.Error as error:
        raise InputError(f"{path}: line 1: {error}.") from error
    twice = sorted({heading for heading in headings if headings.count(heading) > 1})
    if twice:
        raise InputError(f"{path}: several columns are named {', '.join(map(repr, twice))}; rename them.")
    if all(is_number(heading) for heading in headings):
        raise InputError(f"{path}: line 1 holds numbers only; the first line must name the columns.")
    return headings, separator


def _exact(version: str) -> dict[str, str]:
    """Return the option that makes pandas read each decimal as its nearest float64; since 3.1 pandas always does."""
    major, minor = map(int, version.split(".")[:2])
    return {} if (major, minor) >= (3, 1) else {"float_precision": "round_trip"}


def _read(path: Path, headings: list[str], separator: str, decimal: str, lines: int, errors: str):
    pandas = require("pandas", "reading CSV")
    try:
        with warnings.catch_warnings():
            # Without this, rows longer than the header would lose cells with only a warning.
            warnings.simplefilter("error", pandas.errors.ParserWarning)
            return pandas.read_csv(
                path,
                sep=separator,
                decimal=decimal,
                header=None,
                skiprows=lines,
                names=range(len(headings)),
                index_col=False,
                skipinitialspace=True,
                **_exact(pandas.__version__),
                low_memory=False,
                encoding=_ENCODING,
                encoding_errors=errors,
            )
    except pandas.errors.EmptyDataError as error:
        raise InputError(f"{path}: the log is empty: it has columns but no row.") from error
    except pandas.errors.ParserError as error:
        raise InputError(f"{path}: {str(error).strip()}. Correct the line, or name the separator.") from error
    except pandas.errors.ParserWarning as error:
        raise InputError(
            f"{path}: rows have more cells than the first line has names ({len(headings)}). Correct the first line."
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start}); save it as CSV in UTF-8.") from error
