"""MCAP as a log: topics of JSON messages (and of ROS 2, with its own library), each with its own time stamps."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.nested_log import Leaf, NestedLog, in_words
from jaxveh.io.optional import require
from jaxveh.io.units import is_unit

WIDEST = 64
"""Longest list whose numbers become columns; longer lists are pictures and scans."""
DEEPEST = 16

ROS2 = "mcap-ros2-support"


def open_mcap(path: Path, channels: ChannelMap | None) -> NestedLog:
    """Open an `.mcap` file as a log, with a column for each number of a topic's messages.

    `angular_velocity.z` of `/imu` has that name if no other topic has it, otherwise `/imu.angular_velocity.z`. Lists of at
    most 64 numbers become columns `name[0]`, ...; truth values are 0 and 1; null and missing values are NaN; texts are ignored.
    Time is the message's log time, in whole nanoseconds.

    Units are read from topics that `write_topics` wrote. ROS 2 messages (`cdr`) are read if `mcap-ros2-support` is installed.

    **Raises** `InputError` for a damaged file, or a file without a readable topic, with a list of its topics.
    """
    reading = require("mcap.reader", "reading MCAP", "mcap")
    topics, unread, decoders = {}, {}, {}
    try:
        with path.open("rb") as stream:
            reader = reading.make_reader(stream, validate_crcs=True)
            for schema, channel, message in reader.iter_messages():
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(channel, schema, unread)
                decode = decoders[channel.id]
                if decode is None:
                    continue
                topic = topics.setdefault(channel.topic, _Topic(channel, schema))
                topic.add(message.log_time, decode(message.data))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except Exception as error:  # the reader raises any kind of error for a damaged record
        reason = str(error) or type(error).__name__
        raise InputError(f"{path}: is not a readable MCAP file ({reason}). Is the file damaged?") from error
    leaves = [leaf for topic in topics.values() for leaf in topic.leaves()]
    cdr = f" ROS 2 topics need a further library: run `pip install {ROS2}`." if "cdr" in unread.values() else ""
    if not leaves:
        empty = dict.fromkeys(topics, "no numbers")
        raise InputError(
            f"{path}: no topic of JSON messages with numbers; found: {in_words({**unread, **empty})}.{cdr}"
        )
    note = next((topic.source for topic in topics.values() if topic.source), "")
    return NestedLog(path, leaves, note, f"Not read: {in_words(unread)}.{cdr}" if unread else "")


class _Topic:
    """The messages of a topic so far."""

    def __init__(self, channel: Any, schema: Any):
        self.name = channel.topic
        self.source = channel.metadata.get("source", "")
        self._units = _units(schema)
        self._stamps: list[int] = []
        self._rows: list[dict[str, float]] = []

    def add(self, stamp: int, message: Any) -> None:
        self._stamps.append(stamp)
        self._rows.append(dict(_numbers(message, "", 0)))

    def leaves(self) -> Iterator[Leaf]:
        """Yield one column per number, in the order of their first occurrence."""
        # A quotient of integers is rounded only once.
        time = np.array([stamp / 10**9 for stamp in self._stamps])
        for name in dict.fromkeys(name for row in self._rows for name in row):
            values = np.array([row.get(name, np.nan) for row in self._rows])
            yield Leaf(f"{self.name}.{name}", name, time, values, self._units.get(name, ""))


def _numbers(value: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by dotted names."""
    if depth > DEEPEST:
        raise InputError(f"a message is nested more than {DEEPEST} levels deep.")
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _numbers(one, f"{name}.{key}" if name else str(key), depth + 1)
    elif isinstance(value, list | tuple | np.ndarray):
        for k, one in enumerate(value if len(value) <= WIDEST else ()):
            yield from _numbers(one, f"{name}[{k}]", depth + 1)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        try:
            yield name or "value", float(value)
        except OverflowError:
            yield name or "value", float("inf") if value > 0 else float("-inf")


def _units(schema: Any) -> dict[str, str]:
    """Return units by column from a schema that `write_topics` wrote; the descriptions of other schemas are prose."""
    if schema is None or not schema.name.startswith("jaxveh."):
        return {}
    properties = json.loads(schema.data).get("properties", {})
    told = {name: one.get("description", "") for name, one in properties.items() if isinstance(one, Mapping)}
    return {name: unit for name, unit in told.items() if isinstance(unit, str) and is_unit(unit)}


def _decoder(channel: Any, schema: Any, unread: dict[str, str]) -> Any:
    """Return a function from a message's bytes to a mapping; None for an unreadable topic, which is added to `unread`."""
    if channel.message_encoding == "json":
        return json.loads
    if channel.message_encoding == "cdr":
        try:
            factory = importlib.import_module("mcap_ros2.decoder").DecoderFactory()
        except ModuleNotFoundError:
            factory = None
        decode = None if factory is None else factory.decoder_for(channel.message_encoding, schema)
        if decode is not None:
            return lambda data: _as_mapping(decode(data))
    unread[channel.topic] = channel.message_encoding or "no encoding"
    return None


def _as_mapping(message: Any) -> Any:
    """Return a ROS 2 message as mappings and lists."""
    if isinstance(message, list | tuple):
        return [_as_mapping(one) for one in message]
    names = getattr(message, "__slots__", None) or getattr(message, "__dict__", None)
    if not names or isinstance(message, str | bytes | np.generic):
        return message
    return {name.lstrip("_"): _as_mapping(getattr(message, name)) for name in names}
