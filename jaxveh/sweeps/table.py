"""Tables to print."""

from __future__ import annotations

from typing import NamedTuple


class Table(NamedTuple):
    """A table to print: a `title` that describes the numbers, heads of the `columns`, `rows` of cells; `left`: how many of
    the first columns are text."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple]
    left: int = 1
