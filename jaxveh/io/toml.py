"""TOML files as dictionaries, with errors that name file, line, key and allowed range."""

from __future__ import annotations

import math
import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jaxveh._core.errors import InputError, word_for
from jaxveh.io.files import check_readable, write_text
from jaxveh.io.naming import check_known

SHOWN = 200
"""Largest number of characters of a value in a message."""

_ELSEWHERE = ": `jaxveh schema` shows the files; io.read_commonroad reads YAML, `jaxveh tyre` .tir"


def read_toml(path: Path) -> dict[str, Any]:
    """Return the contents of a file; raise `InputError` with file and line if it is not TOML."""
    check_readable(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: broken TOML: not UTF-8 text (byte {error.start}); save it as UTF-8.") from error
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also integers too large, and lists too deep, for Python
        other = (
            ""
            if path.suffix.lower() == ".toml"
            else f" (or no TOML at all, as {path.suffix or 'its name'} suggests{_ELSEWHERE})"
        )
        raise InputError(f"{path}: broken TOML{other}: {error}{_line(text, str(error))}.") from error


def write_toml(lines: Iterable[str], path: str | os.PathLike, overwrite: bool, note: str = "") -> None:
    """Write lines of TOML below a `note`, whose lines become comments; completely or not at all.

    **Raises** `InputError` for a note that is no text, and if the file exists and `overwrite` is False.
    """
    if not isinstance(note, str):
        raise InputError(f"note = {word_for(note)}: must be text, which becomes comment lines at the top of the file.")
    comments = [f"# {line}".rstrip() for line in note.splitlines()]
    write_text("\n".join([*comments, *lines]) + "\n", path, overwrite)


def _line(text: str, told: str) -> str:
    """Return the line of a message in words, with the form that it should have; "" if the message names none."""
    found = re.search(r"at line (\d+)", told)
    lines = text.splitlines()
    if found is None or not 0 < int(found[1]) <= len(lines):
        return ""
    line = shorten(lines[int(found[1]) - 1].strip())
    return f": {line}; lines are `key = value`, with decimal points, texts in quotes, and # before comments"


FILES = {
    "calibration": ({"estimator", "parameters"}, "a calibration (jaxveh fit -o; it is read by --calibration)"),
    "study": ({"drive"}, "a study (it is read by jaxveh sweep)"),
    "channel map": ({"channels"}, "a channel map (it is read by --channels)"),
    "tyre": ({"tyre"}, "a tyre's parameter file"),
    "car": ({"mass", "front_axle_to_cg"}, "a car's file (it is read by --vehicle)"),
    "road": ({"friction"}, "a road's file (it is read by --road)"),
}
"""The files of this format by their kind: keys that a file of the kind has, and what it is in words."""


def check_file(path: Path, content: Mapping[str, Any], kind: str, allowed: Iterable[str]) -> None:
    """Raise `InputError` if a file has keys that are not allowed and is of another kind, which the message tells."""
    strange = set(content) - set(allowed)
    for other, (marks, words) in FILES.items():
        if strange and other != kind and marks <= set(content):
            raise InputError(f"{path}: is {words}; a {kind} file is needed here.")


def check_keys(where: str, table: object, allowed: Iterable[str]) -> None:
    """Raise `InputError` unless `table` is a table whose keys are all allowed."""
    if not isinstance(table, Mapping):
        raise InputError(f"{where} = {table!r}: must be a table of keys.")
    for key in table:
        check_known(where, "key", key, allowed)


def toml_number(where: str, value: object) -> float:
    """Return a TOML number as a finite float; raise `InputError` for anything else (true and false included)."""
    try:
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{where} = {shorten(value)}: must be a finite number.")
    return number


def shorten(value: object) -> str:
    """Return a value for a message, shortened: values in files may be pages long."""
    shown = repr(value)
    return shown if len(shown) <= SHOWN else f"{shown[:SHOWN]}..."


def toml_text(where: str, value: object) -> str:
    """Return a TOML string; raise `InputError` for anything else."""
    if not isinstance(value, str):
        raise InputError(f"{where} = {value!r}: must be a string in quotes.")
    return value


def toml_string(value: str) -> str:
    """Return a string in TOML's notation."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
