"""Logs whose columns form a tree: MATLAB's structs, and messages with nested fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.log import Column, Log, numeric
from jaxveh.io.naming import check_known


class Leaf(NamedTuple):
    """A column with its full `path` in the file (such as `log.speed`, or `/imu.angular_velocity.z`) and its `short` name."""

    path: str
    short: str
    time: np.ndarray
    values: np.ndarray
    unit: str = ""


class NestedLog(Log):
    """A log of leaves with their own time stamps.

    A column has its short name if that is unique, otherwise its full path; it can be loaded by either name.
    """

    def __init__(self, path: Path, leaves: Sequence[Leaf], note: str = "", without: str = ""):
        self.path, self.note = path, note
        shorts = [leaf.short for leaf in leaves]
        self._names = {leaf.short if shorts.count(leaf.short) == 1 else leaf.path: leaf for leaf in leaves}
        self._paths = {leaf.path: leaf for leaf in leaves}
        self._without = without
        self.names = tuple(self._names)

    def column(self, name: str, group: int | None = None) -> Column:
        if name not in self._names and name not in self._paths:
            advice = "Name the file's column in the channel map." + (f" {self._without}" if self._without else "")
            check_known(str(self.path), "column", name, self._names, advice)
        leaf = self._names.get(name) or self._paths[name]
        values = numeric(leaf.values, f"{self.path}: column {name!r}")
        back = np.flatnonzero(~(np.diff(leaf.time) > 0))
        if back.size:
            k = int(back[0])
            raise InputError(
                f"{self.path}: column {name!r}: time[{k + 1}] = {leaf.time[k + 1]} after time[{k}] = {leaf.time[k]}: must be "
                "strictly increasing. Correct its time stamps, or leave the column out."
            )
        return Column(leaf.time, values, leaf.unit)


def in_words(names: Mapping[str, str] | Sequence[str], most: int = 12) -> str:
    """List names in words, with the description of each if `names` is a mapping; after `most` of them the list is cut, with a
    count of the rest."""
    words = [f"{name} ({what})" for name, what in names.items()] if isinstance(names, Mapping) else list(names)
    more = f", and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more if words else "nothing"
