"""TOML files as dictionaries, with errors that name file, line, key and allowed range."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jaxveh._core.errors import InputError
from jaxveh.io.files import check_readable
from jaxveh.io.naming import check_known

SHOWN = 200
"""So many characters of a value are shown in a message."""


def read_toml(path: Path) -> dict[str, Any]:
    """The file's content; raises `InputError` with file and line where it is not TOML."""
    check_readable(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: broken TOML: not UTF-8 text (byte {error.start}).") from error
    except (ValueError, RecursionError) as error:  # whole numbers and nests of lists that are too large for Python, too
        raise InputError(f"{path}: broken TOML: {error}.") from error


def check_keys(where: str, table: object, allowed: Iterable[str]) -> None:
    """Raise unless `table` is a table whose keys are all allowed."""
    if not isinstance(table, Mapping):
        raise InputError(f"{where} = {table!r}: must be a table of keys.")
    for key in table:
        check_known(where, "key", key, allowed)


def toml_number(where: str, value: object) -> float:
    """A TOML number as a finite float; raises for anything else (true and false included)."""
    try:
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{where} = {shorten(value)}: must be a finite number.")
    return number


def shorten(value: object) -> str:
    """A value for a message: a stranger's may be pages long."""
    shown = repr(value)
    return shown if len(shown) <= SHOWN else f"{shown[:SHOWN]}..."


def toml_text(where: str, value: object) -> str:
    """A TOML string; raises for anything else."""
    if not isinstance(value, str):
        raise InputError(f"{where} = {value!r}: must be a string in quotes.")
    return value


def toml_string(value: str) -> str:
    """A string as TOML writes it."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
