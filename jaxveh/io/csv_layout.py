"""Where the names, the units and the rows of a text table are: loggers write lines about the drive above them."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from jaxveh._core.errors import InputError
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.decimals import is_number
from jaxveh.io.naming import split_unit
from jaxveh.io.race_capture import CLOCK, named_by_race_capture
from jaxveh.io.stamps import is_stamp
from jaxveh.io.units import is_unit, is_unit_name, without_brackets

HEAD = 400
"""The number of lines among which the names and the first rows must be."""

ALIKE = 3
"""The number of lines that must look like rows for the first of them to be the first row."""

BLANKS = r"\s+"
"""The separator of columns of text with blanks between them."""

SEPARATORS = (",", ";", "\t", "|", BLANKS)
COMMENT = ("#", "//")

_COMMA = re.compile(r"[-+]?(?P<whole>\d+),(?P<part>\d+)([eE][-+]?\d+)?")
_SEPARATOR_LINE = re.compile(r"\"?sep=(?P<separator>.)\"?\s*", re.IGNORECASE)


class Layout(NamedTuple):
    """The parts of a text table.

    `headings`: the names; `units`: by heading, empty without a line of units; `first`: the number of lines above the rows;
    `remarks`: what was assumed, in words; `clock`: the heading of the time, "" where the format does not tell.
    """

    headings: list[str]
    units: dict[str, str]
    first: int
    separator: str
    decimal: str
    encoding: str
    remarks: tuple[str, ...]
    clock: str = ""


def find_layout(path: Path, told: ChannelMap | None) -> Layout:
    """Find the layout of a text table; what a channel map has `told` about it is not searched for.

    The names are in the last line above the first rows of numbers; a line of units may be between them.

    **Raises** `InputError` for bytes that are no text, and names that cannot be found.
    """
    encoding, remark = text_encoding(path, told.encoding if told else None)
    try:
        with path.open(encoding=encoding, newline=None) as file:
            lines = [line for _, line in zip(range(HEAD), file, strict=False)]
    except (UnicodeDecodeError, LookupError) as error:
        raise InputError(
            f"{path}: is not text in {encoding} ({error}); correct `encoding` in the channel map."
        ) from error
    if all(map(_is_blank, lines)):
        raise InputError(f"{path}: has no line with a content among the first {HEAD}.")
    try:
        return _layout(path, lines, encoding, (remark,) if remark else (), told)
    except csv.Error as error:
        raise InputError(f"{path}: is no table of text ({error}). Correct the line, or name the separator.") from error


def _layout(
    path: Path, lines: Sequence[str], encoding: str, assumed: tuple[str, ...], told: ChannelMap | None
) -> Layout:
    said = _SEPARATOR_LINE.fullmatch(lines[0])
    separator = (told.separator if told else None) or (said["separator"] if said else None)
    separator = BLANKS if separator == " " else separator
    names, units, first, separator = _places(path, lines, separator, told.names_line if told else None)
    headings = _names(lines[names], separator, path, names)
    capture = named_by_race_capture(headings)
    headings = capture[0] if capture else headings
    remarks = list(assumed)
    above = [line for line in lines[:names] if line.strip() and not line.startswith(COMMENT)]
    if len(above) > (said is not None) and not (told and told.names_line):
        remarks.append(f"the columns' names are in line {names + 1}; the lines above are not read")
    below = [k + 1 for k in range(names + 1, first) if k != units and not _is_blank(lines[k])]
    if below and not (told and told.names_line):
        remarks.append(f"between the names and the rows, line {', '.join(map(str, below))} is not read")
    told_units = [] if units is None else [without_brackets(one) for one in _head(lines[units], separator)]
    told_units = capture[1] if capture else told_units
    clock = CLOCK if capture and headings.count(CLOCK) == 1 else ""
    by_name = dict(zip([*headings, *with_numbers(headings)], [*told_units, *told_units], strict=False))
    decimal = (told.decimal if told else None) or _decimal(lines[first:], separator)
    return Layout(headings, by_name, first, separator, decimal, encoding, tuple(remarks), clock)


def with_numbers(headings: Sequence[str]) -> list[str]:
    """Return the headings, those of several columns with the number of the column, such as `speed (column 14) [km/h]`."""

    def of(heading: str, column: int) -> str:
        name, unit = split_unit(heading)
        return f"{name} (column {column})" + (f" [{unit}]" if unit else "")

    return [h if headings.count(h) == 1 else of(h, k) for k, h in enumerate(headings, start=1)]


def text_encoding(path: Path, told: str | None) -> tuple[str, str]:
    """Return the encoding of a file, and what was assumed about it."""
    with path.open("rb") as file:
        head = file.read(4096)
    if told is not None:
        return told, ""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16", ""
    if b"\0" in head:
        raise InputError(
            f'{path}: contains zero bytes: it is no text, or is in UTF-16: set encoding = "utf-16-le" under [csv] in the '
            "channel map, or save it as CSV in UTF-8."
        )
    wrong = _undecodable(path, "utf-8")
    if wrong is None:
        return "utf-8-sig", ""
    if _undecodable(path, "cp1252") is not None:
        raise InputError(f"{path}: is not UTF-8 text (byte {wrong}), nor Windows-1252; save it as CSV in UTF-8.")
    return "cp1252", f"is not UTF-8 text (byte {wrong}): read as Windows-1252"


def _undecodable(path: Path, encoding: str) -> int | None:
    """Return the position of the first byte that is not of an encoding; None if there is none."""
    decoder, at = codecs.getincrementaldecoder(encoding)(), 0
    with path.open("rb") as file:
        while True:
            block = file.read(1 << 22)
            before = len(decoder.getstate()[0])
            try:
                decoder.decode(block, final=not block)
            except UnicodeDecodeError as error:
                return at - before + error.start
            if not block:
                return None
            at += len(block)


def _places(
    path: Path, lines: Sequence[str], separator: str | None, named: int | None
) -> tuple[int, int | None, int, str]:
    """Return the lines of the names, of the units (None for none) and of the first row, and the separator."""
    if named is not None:
        if named > len(lines):
            raise InputError(f"{path}: names_line = {named}: must be at most {len(lines)}.")
        line = lines[named - 1]
        usual = separator or (max(",;\t|", key=line.count) if any(map(line.count, ",;\t|")) else BLANKS)
        below = [k for k in range(named, len(lines)) if not _is_blank(lines[k])]
        first = next((k for k in below if _is_row(_split(lines[k], usual))), named)
        units = next((k for k in below if k < first and _are_units(_head(lines[k], usual))), None)
        return named - 1, units, first, usual
    for first in range(1, len(lines)):
        for one in (separator,) if separator else SEPARATORS:
            counts = _alike(lines, first, one)
            if counts and (found := _above(lines, first, one, counts)) is not None:
                return *found, first, one
    # What is none of this is read as one line of names, for a message about the rows below.
    return 0, None, 1, separator or max(",;\t|", key=lines[0].count)


def _alike(lines: Sequence[str], first: int, separator: str) -> tuple[int, ...]:
    """Return the number of columns of the rows that begin with a line; none unless it and the next lines are rows alike.

    Where each row ends with a separator, there may also be one column less.
    """
    rows: list[list[str]] = []
    for line in lines[first:]:
        if not _is_blank(line):
            rows.append(_split(line, separator))
            if not _is_row(rows[-1]):
                return ()
        elif not rows:
            return ()
        if len(rows) == ALIKE:
            break
    counts = {len(cells) for cells in rows}
    if len(counts) != 1:
        return ()
    count = counts.pop()
    both = (count, count - 1) if all(cells[-1] == "" for cells in rows) else (count,)
    return tuple(one for one in both if one > 1)


def _above(lines: Sequence[str], first: int, separator: str, counts: tuple[int, ...]) -> tuple[int, int | None] | None:
    """Return the lines of names and units above the first row, which has one of these numbers of cells; None without names.

    A line of one cell just above the rows is the title of their section. The units are in the line above the rows. They may also
    be in the one before it, if the last line has cells that are empty or alike (sources of the columns): it names none.
    """
    above = [k for k in range(first) if not _is_blank(lines[k])][-4:]
    if len(above) > 1 and sum(map(bool, _head(lines[above[-1]], separator))) == 1:
        above.pop()
    above = above[-3:]
    cells = [_head(lines[k], separator) for k in above]
    fits = lambda one: _filled(one) in counts and _are_words(one)
    names_none = len(above) > 2 and len(set(cells[-1])) < len(cells[-1])
    for last in range(len(above) - 1, 0 if names_none else max(0, len(above) - 2), -1):
        if _are_units(cells[last]) and fits(cells[last - 1]):
            return above[last - 1], above[last]
    return (above[-1], None) if above and fits(cells[-1]) else None


def _head(line: str, separator: str) -> list[str]:
    """Return the cells of a line above the rows, which some programs mark as a comment: `# time v_x`."""
    return _split(line.lstrip("\ufeff ").removeprefix("#"), separator)


def _split(line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return line.split()
    cells = next(csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def _names(line: str, separator: str, path: Path, number: int) -> list[str]:
    names = _head(line, separator)
    if not names or all(map(is_number, names)) or all(map(is_number, line.split())):
        raise InputError(f"{path}: line {number + 1} holds numbers only; the first line must name the columns.")
    return names


def _filled(cells: Sequence[str]) -> int:
    """Return the number of cells up to the last one with a content."""
    return max((k for k, cell in enumerate(cells, start=1) if cell), default=0)


def _is_blank(line: str) -> bool:
    return not line.strip(' ,;\t|"\r\n')


def _is_value(cell: str) -> bool:
    return is_number(cell) or _COMMA.fullmatch(cell) is not None or is_stamp(cell)


def _is_row(cells: Sequence[str]) -> bool:
    """Whether at least half of the cells with a content are values."""
    told = [cell for cell in cells if cell]
    return bool(told) and 2 * sum(map(_is_value, told)) >= len(told)


def _are_words(cells: Sequence[str]) -> bool:
    return any(cells) and not any(map(_is_value, filter(None, cells)))


def _are_units(cells: Sequence[str]) -> bool:
    """Whether cells are units: half of them are known, and one of them is that of a channel."""
    told = [without_brackets(cell) for cell in cells if cell]
    known = [one for one in told if is_unit_name(one)]
    return bool(known) and 2 * (len(known) + sum(not is_unit(one) or one == "1" for one in told)) >= len(told)


def _decimal(lines: Sequence[str], separator: str) -> str:
    """Return the decimal sign of the rows: a comma if it can be nothing else, otherwise a point."""
    if separator == ",":
        return "."
    cells = list(_cells(lines, separator))
    commas = [found for cell in cells if (found := _COMMA.fullmatch(cell)) is not None]
    points = any("." in cell and is_number(cell) for cell in cells)
    # 1,234 may also be a thousand and more.
    sure = any(len(one["part"]) != 3 or len(one["whole"]) > 3 or one["whole"] == "0" for one in commas)
    return "," if sure and not points else "."


def _cells(lines: Sequence[str], separator: str) -> Iterator[str]:
    for line in lines:
        yield from _split(line, separator)
