"""Tables for people."""

from __future__ import annotations

from typing import NamedTuple


class Table(NamedTuple):
    """A table for people: a title that says what the numbers are, column heads, rows of cells; `left`: how many of the first
    columns are words."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple]
    left: int = 1
