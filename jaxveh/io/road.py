"""The file that describes a road: TOML in SI units, tables over distance, checked key by key."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check, check_flags, check_kind, check_one_of, path_of
from jaxveh.io.toml import check_file, check_keys, read_toml, toml_number, toml_string, toml_text, write_toml

ROAD_SCHEMA = """\
# A road along the x axis. SI units; y left, z up.
# Each table has one value per distance; the first and last values hold beyond the ends. A single number instead of a
# table holds for the whole road.
distance = [0.0, 100.0, 200.0]  # m, increasing; may be omitted if everything else is a single number
friction = [1.0, 1.0, 0.4]      # relative to the road on which the tyres were measured; default 1

# All that follows is optional.
name = "wet hill"
grade = [0.0, 0.05, 0.0]        # rad, uphill positive; default 0
bank = 0.02                     # rad, left side higher positive; default 0
interpolation = "smooth"        # between the points: "smooth" (monotone cubics) or "linear"
"""
"""The file's schema as a commented, valid example, for programs to print."""

_RANGES = {
    "distance": (-1e6, 1e6, " m"),
    "friction": (1e-3, 10.0, ""),
    "grade": (-0.5, 0.5, " rad"),
    "bank": (-0.8, 0.8, " rad"),
}


@dataclass(frozen=True)
class RoadSpecification:
    """The contents of a road file: numbers, or tuples over `distance`, in SI units. See `road.ROAD_SCHEMA`.

    **Raises** `InputError` with name, value and allowed range for distances that do not increase, tables of another
    length, and values that no road has.
    """

    distance: tuple[float, ...] | None = None
    friction: float | tuple[float, ...] = 1.0
    grade: float | tuple[float, ...] = 0.0
    bank: float | tuple[float, ...] = 0.0
    interpolation: str = "smooth"
    name: str | None = None

    def __post_init__(self):
        check_one_of("interpolation", self.interpolation, ("smooth", "linear"))
        for key, (low, high, unit) in _RANGES.items():
            value = getattr(self, key)
            if value is None:
                continue
            object.__setattr__(self, key, float(value) if np.ndim(value) == 0 else tuple(map(float, value)))
            allowed = f"between {low:g} and {high:g}{unit}"
            check(key, np.asarray(value, float), lambda v, low=low, high=high: (v >= low) & (v <= high), allowed)
        self._check_tables()

    def _check_tables(self):
        if self.distance is not None:
            if not isinstance(self.distance, tuple) or len(self.distance) < 2:
                raise InputError(f"distance = {self.distance}: must be a list of at least two distances.")
            if not np.all(np.diff(self.distance) > 0):
                raise InputError(f"distance = {list(self.distance)}: must increase from point to point.")
        for key in ("friction", "grade", "bank"):
            value = getattr(self, key)
            if not isinstance(value, tuple):
                continue
            if self.distance is None:
                raise InputError(f"distance is missing: {key} is a table, and needs one.")
            if len(value) != len(self.distance):
                raise InputError(f"{key} has {len(value)} values: must have {len(self.distance)}, as distance.")


def read_road(path: str | os.PathLike) -> RoadSpecification:
    """Read a road from TOML (`road.ROAD_SCHEMA`).

    **Raises** `InputError` naming the file and: the line of broken TOML, an unknown key (with similar ones), or
    a value with its allowed range.
    """
    path = path_of(path)
    content = read_toml(path)
    names = [entry.name for entry in fields(RoadSpecification)]
    check_file(path, content, "road", names)
    check_keys(str(path), content, names)
    try:
        return RoadSpecification(**{key: _value(key, value) for key, value in content.items()})
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def write_road(road: RoadSpecification, path: str | os.PathLike, *, note: str = "", overwrite: bool = False) -> None:
    """Write a road as TOML that `read_road` reads back bit for bit; `note` becomes comment lines at the top.

    The file is written completely or not at all. **Raises** `InputError` if it exists and `overwrite` is False.
    """
    check_flags(overwrite=overwrite)
    check_kind("write_road: road", road, RoadSpecification, "io.read_road reads one from a file.")
    lines = []
    for entry in fields(road):
        value = getattr(road, entry.name)
        if value is not None:
            shown = toml_string(value) if isinstance(value, str) else list(value) if isinstance(value, tuple) else value
            lines.append(f"{entry.name} = {shown}")
    write_toml(lines, path, overwrite, note)


def _value(key: str, value: Any) -> Any:
    if key in ("interpolation", "name"):
        return toml_text(key, value)
    if isinstance(value, list):
        return tuple(toml_number(f"{key}[{index}]", item) for index, item in enumerate(value))
    return toml_number(key, value)
