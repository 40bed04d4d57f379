"""A channel map: the columns of a log for the channels, with units and signs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jaxveh._core.errors import InputError, check, check_finite, check_one_of
from jaxveh.io.toml import check_keys, read_toml, shorten, toml_number, toml_text

CHANNEL_MAP_SCHEMA = """\
# A channel map. Everything but `column` is optional.
time = "Time"               # the time column; or { column = "Time", unit = "ms" }. Not used for MDF4.

[channels.yaw_rate]         # the channel's name; `jaxveh.io.CANONICAL` lists the known names with their units
column = "Gierrate"         # its name in the file
unit = "deg/s"              # its unit in the file; converted to SI. Default: the file's own unit, otherwise SI
sign = -1                   # 1 or -1: axes are x forward, y left, z up; turns to the left are positive
scale = 1.0                 # the value is sign * (scale * column + offset), in `unit`
offset = 0.0
group = 3                   # MDF4 only: the channel group, if several have a column of this name

[channels]
v_x = "Speed"               # short for { column = "Speed" }

[csv]                       # CSV only
separator = ";"             # default: the most frequent of , ; and tab in the header line
decimal = ","               # default: a point
"""
"""The file's schema as a commented example, for programs to print."""

MOST_GROUPS = 2**31


@dataclass(frozen=True)
class Channel:
    """The column of a channel in a file: its value is `sign * (scale * column + offset)` in `unit` (None: the file's)."""

    column: str
    unit: str | None = None
    sign: float = 1
    scale: float = 1.0
    offset: float = 0.0
    group: int | None = None

    def __post_init__(self):
        check_one_of("sign", self.sign, (1, -1))
        check("scale", self.scale, lambda v: (v != 0) & (abs(v) < float("inf")), "finite and not zero")
        check_finite("offset", self.offset)


@dataclass(frozen=True)
class ChannelMap:
    """The columns to read from a log, by channel name; see `channel_map.CHANNEL_MAP_SCHEMA` for the file.

    `channels`: name to `Channel` (a string is short for `Channel(column)`); `time`: the time column, None for the usual
    names; `separator`, `decimal`: of a CSV file; `source`: the origin of the map, for messages.
    """

    channels: Mapping[str, Channel]
    time: Channel | None = None
    separator: str | None = None
    decimal: str = "."
    source: str = field(default="channel map", compare=False)

    def __post_init__(self):
        object.__setattr__(self, "channels", {name: _channel(entry) for name, entry in self.channels.items()})
        object.__setattr__(self, "time", None if self.time is None else _channel(self.time))
        if not self.channels:
            raise InputError(f"{self.source}: has no channel; add a table [channels.NAME] with its column.")
        check_one_of(f"{self.source}: decimal", self.decimal, (".", ","))
        if self.separator is not None and len(self.separator) != 1:
            raise InputError(f"{self.source}: separator = {self.separator!r}: must be one character.")


def read_channel_map(path: str | os.PathLike) -> ChannelMap:
    """Read a channel map from TOML (`channel_map.CHANNEL_MAP_SCHEMA`).

    **Raises** `InputError` naming file and line of broken TOML, unknown keys with similar ones, values of a wrong
    kind.
    """
    path = Path(path)
    content = read_toml(path)
    check_keys(str(path), content, ("time", "channels", "csv"))
    csv = content.get("csv", {})
    check_keys(f"{path}: [csv]", csv, ("separator", "decimal"))
    channels = content.get("channels", {})
    if not isinstance(channels, Mapping):
        raise InputError(f"{path}: channels = {channels!r}: must be tables [channels.NAME].")
    return ChannelMap(
        channels={name: _entry(f"{path}: [channels.{name}]", entry) for name, entry in channels.items()},
        time=_entry(f"{path}: time", content["time"]) if "time" in content else None,
        separator=toml_text(f"{path}: separator", csv["separator"]) if "separator" in csv else None,
        decimal=toml_text(f"{path}: decimal", csv.get("decimal", ".")),
        source=str(path),
    )


def _channel(entry: Channel | str) -> Channel:
    return Channel(entry) if isinstance(entry, str) else entry


def _entry(where: str, entry: Any) -> Channel:
    if isinstance(entry, str):
        return Channel(entry)
    check_keys(where, entry, ("column", "unit", "sign", "scale", "offset", "group"))
    if "column" not in entry:
        raise InputError(f'{where}: has no `column`; add column = "NAME IN THE FILE".')
    group = entry.get("group")
    if group is not None and (isinstance(group, bool) or not isinstance(group, int) or not 0 <= group < MOST_GROUPS):
        raise InputError(f"{where}: group = {shorten(group)}: must be a whole number from 0 to {MOST_GROUPS - 1}.")
    try:
        return Channel(
            column=toml_text(f"{where}: column", entry["column"]),
            unit=toml_text(f"{where}: unit", entry["unit"]) if "unit" in entry else None,
            sign=toml_number(f"{where}: sign", entry.get("sign", 1)),
            scale=toml_number(f"{where}: scale", entry.get("scale", 1.0)),
            offset=toml_number(f"{where}: offset", entry.get("offset", 0.0)),
            group=group,
        )
    except InputError as error:
        raise error if str(error).startswith(where) else InputError(f"{where}: {error}") from error
