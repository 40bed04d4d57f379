"""A channel map: the columns of a log for the channels, with units and signs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from jaxveh._core.errors import InputError, check, check_finite, check_one_of, path_of
from jaxveh.io.toml import check_file, check_keys, read_toml, shorten, toml_number, toml_text

CHANNEL_MAP_SCHEMA = """\
# A channel map. Everything but `column` is optional.
time = "Time"               # the time column; or { column = "Time", unit = "ms" }. Not used for MDF4.
repeats = "last"            # which of several rows with one time counts where they contradict: "first" or "last". Default: none

[channels.yaw_rate]         # the channel's name; `jaxveh.io.CANONICAL` lists the known names with their units
column = "Gierrate"         # its name in the file
unit = "deg/s"              # its unit in the file; converted to SI. Default: the file's own unit, otherwise SI
sign = -1                   # 1 or -1: axes are x forward, y left, z up; turns to the left are positive
scale = 1.0                 # the value is sign * (scale * column + offset), in `unit`
offset = 0.0
group = 3                   # MDF4 only: the channel group, if several have a column of this name
time = "Time_2"             # CSV and Parquet only: its own time column, if the columns do not share one; or with unit, as above

[channels]                  # without any channel, every column is one with its own name
v_x = "Speed"               # short for { column = "Speed" }

[csv]                       # text only; what is not given here is found in the file
separator = ";"             # one character; " " for any number of blanks
decimal = ","               # or "."
names_line = 15             # the number of the line with the names of the columns
encoding = "utf-8"          # or "cp1252", "utf-16-le", ...
"""
"""The file's schema as a commented example, for programs to print."""

MOST_GROUPS = 2**31


@dataclass(frozen=True)
class Channel:
    """The column of a channel in a file: its value is `sign * (scale * column + offset)` in `unit` (None: the file's).

    `time`: the column of its time stamps in a CSV or Parquet file (a string is short for `Channel(column)`), None for the log's.
    """

    column: str
    unit: str | None = None
    sign: float = 1
    scale: float = 1.0
    offset: float = 0.0
    group: int | None = None
    time: Channel | None = None

    def __post_init__(self):
        if isinstance(self.time, str):
            object.__setattr__(self, "time", Channel(self.time))
        check_one_of("sign", self.sign, (1, -1))
        check("scale", self.scale, lambda v: (v != 0) & (abs(v) < float("inf")), "finite and not zero")
        check_finite("offset", self.offset)


@dataclass(frozen=True)
class ChannelMap:
    """The columns to read from a log, by channel name; see `channel_map.CHANNEL_MAP_SCHEMA` for the file.

    `channels`: name to `Channel` (a string is short for `Channel(column)`); without any, every column is a channel with its own
    name. `time`: the time column, None for the usual names. Of a text file: `separator` (a blank for any number of blanks),
    `decimal`, `names_line` (the number of the line with the names, from 1) and `encoding`; None for what the file shows.
    `repeats`: of several rows with one time the one that counts where they contradict, `first` or `last`; None if none does.
    `source`: the origin of the map, for messages.
    """

    channels: Mapping[str, Channel] = field(default_factory=dict)
    time: Channel | None = None
    separator: str | None = None
    decimal: str | None = None
    names_line: int | None = None
    encoding: str | None = None
    repeats: str | None = None
    source: str = field(default="channel map", compare=False)

    def __post_init__(self):
        object.__setattr__(self, "channels", {name: _channel(entry) for name, entry in self.channels.items()})
        object.__setattr__(self, "time", None if self.time is None else _channel(self.time))
        told = (self.time, self.separator, self.decimal, self.names_line, self.encoding, self.repeats)
        if not self.channels and all(one is None for one in told):
            raise InputError(f"{self.source}: has no channel; add a table [channels.NAME] with its column.")
        if self.decimal is not None:
            check_one_of(f"{self.source}: decimal", self.decimal, (".", ","))
        if self.repeats is not None:
            check_one_of(f"{self.source}: repeats", self.repeats, ("first", "last"))
        if self.separator is not None and len(self.separator) != 1:
            raise InputError(f"{self.source}: separator = {self.separator!r}: must be one character.")
        if self.separator is not None and self.separator == self.decimal:
            raise InputError(f"{self.source}: separator and decimal are both {self.decimal!r}; they must differ.")
        if self.names_line is not None and self.names_line < 1:
            raise InputError(f"{self.source}: names_line = {self.names_line}: must be the number of a line, from 1.")
        if self.encoding is not None:
            _check_encoding(self.encoding, self.source)

    @property
    def shares_time(self) -> bool:
        """Whether some channel has no time column of its own."""
        return not self.channels or any(one.time is None for one in self.channels.values())


def read_channel_map(path: str | os.PathLike) -> ChannelMap:
    """Read a channel map from TOML (`channel_map.CHANNEL_MAP_SCHEMA`).

    **Raises** `InputError` naming file and line of broken TOML, unknown keys with similar ones, values of a wrong
    kind.
    """
    path = path_of(path)
    content = read_toml(path)
    keys = ("time", "repeats", "channels", "csv")
    check_file(path, content, "channel map", keys)
    check_keys(str(path), content, keys)
    csv = content.get("csv", {})
    check_keys(f"{path}: [csv]", csv, ("separator", "decimal", "names_line", "encoding"))
    channels = content.get("channels", {})
    if not isinstance(channels, Mapping):
        raise InputError(f"{path}: channels = {channels!r}: must be tables [channels.NAME].")
    return ChannelMap(
        channels={name: _entry(f"{path}: [channels.{name}]", entry) for name, entry in channels.items()},
        time=_entry(f"{path}: time", content["time"]) if "time" in content else None,
        **{key: toml_text(f"{path}: {key}", csv[key]) for key in ("separator", "decimal", "encoding") if key in csv},
        repeats=toml_text(f"{path}: repeats", content["repeats"]) if "repeats" in content else None,
        names_line=_whole(f"{path}: names_line", csv["names_line"], 1) if "names_line" in csv else None,
        source=str(path),
    )


def _channel(entry: Channel | str) -> Channel:
    return Channel(entry) if isinstance(entry, str) else entry


def _entry(where: str, entry: Any) -> Channel:
    if isinstance(entry, str):
        return Channel(entry)
    check_keys(where, entry, ("column", "unit", "sign", "scale", "offset", "group", "time"))
    if "column" not in entry:
        raise InputError(f'{where}: has no `column`; add column = "NAME IN THE FILE".')
    try:
        return Channel(
            column=toml_text(f"{where}: column", entry["column"]),
            unit=toml_text(f"{where}: unit", entry["unit"]) if "unit" in entry else None,
            sign=toml_number(f"{where}: sign", entry.get("sign", 1)),
            scale=toml_number(f"{where}: scale", entry.get("scale", 1.0)),
            offset=toml_number(f"{where}: offset", entry.get("offset", 0.0)),
            group=_whole(f"{where}: group", entry["group"], 0) if "group" in entry else None,
            time=_entry(f"{where}: time", entry["time"]) if "time" in entry else None,
        )
    except InputError as error:
        raise error if str(error).startswith(where) else InputError(f"{where}: {error}") from error


def _whole(where: str, value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value < MOST_GROUPS:
        raise InputError(f"{where} = {shorten(value)}: must be a whole number from {least} to {MOST_GROUPS - 1}.")
    return value


def _check_encoding(encoding: str, source: str) -> None:
    try:
        "".encode(encoding)
    except (LookupError, ValueError) as error:
        raise InputError(
            f"{source}: encoding = {encoding!r}: is not known; such as utf-8, cp1252, utf-16-le."
        ) from error
