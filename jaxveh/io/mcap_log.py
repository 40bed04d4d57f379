"""MCAP for Foxglove and PlotJuggler: topics of JSON messages, each with a JSON schema, stamped with the log's time."""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_flags, path_of
from jaxveh.io.files import check_suffix, replacing_file
from jaxveh.io.log import numeric
from jaxveh.io.optional import require

MCAP_SUFFIX = ".mcap"
"""The ending of an MCAP file's name."""
LATEST = 2**63 / 1e9
"""The largest time stamp, s."""


def write_topics(topics: Mapping[str, Any], path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write data frames as topics of an `.mcap` file, such as `/estimate`, `/log` and `/truth`, completely or not at all.

    `topics`: name to a data frame with a column `time` (s, at least zero, strictly increasing) and columns of numbers, as
    `to_frame` makes them. Each row is a message: its JSON has one number per column, without those that are not finite, and is
    stamped with the row's time in nanoseconds. The messages of all topics are ordered by time. The schema has each column's
    unit, from `frame.attrs["units"]`, in its `description`; `frame.attrs["source"]` is the channel's metadata `source`.

    **Raises** `InputError` for another suffix, no topic, a frame without `time` or with columns that are not numbers, times that
    cannot be time stamps, or if the file exists and `overwrite` is False.
    """
    check_flags(overwrite=overwrite)
    path = path_of(path)
    check_suffix(path, (MCAP_SUFFIX,), "recording of topics")
    writing = require("mcap.writer", "writing MCAP", "mcap")
    if not topics:
        raise InputError(f"{path}: no topic to write; give at least one.")
    tables = {topic: _columns(frame, f"{path}: topic {topic}") for topic, frame in topics.items()}
    with replacing_file(path, overwrite) as part, part.open("wb") as stream:
        writer = writing.Writer(stream)
        writer.start(profile="", library="jaxveh")
        queues = []
        for place, (topic, (stamps, columns)) in enumerate(tables.items()):
            attributes = topics[topic].attrs
            channel = _register(writer, topic, columns, attributes.get("units", {}), attributes.get("source", ""))
            queues.append(_messages(stamps, columns, place, channel))
        for stamp, _, row, channel, message in heapq.merge(*queues, key=lambda one: one[:2]):
            writer.add_message(channel, log_time=stamp, data=message, publish_time=stamp, sequence=row)
        writer.finish()


def _columns(frame: Any, what: str) -> tuple[list[int], dict[str, np.ndarray]]:
    """Return time stamps (T,) in nanoseconds, and columns (T,) by name."""
    if "time" not in frame.columns:
        raise InputError(f"{what}: no column `time`; there are: {', '.join(map(str, frame.columns))}.")
    columns = {str(name): numeric(frame[name].to_numpy(), f"{what}: column {name!r}") for name in frame.columns}
    time = np.asarray(columns.pop("time"), np.float64)
    wrong = ~((time >= 0) & (time < LATEST)) | np.r_[False, np.diff(time) <= 0]
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"{what}: time[{k}] = {time[k]}: time stamps must be at least zero and strictly increasing. Shift the log's time, or "
            "write another format."
        )
    # Multiplying large numbers of seconds by 1e9 would not be exact.
    return [int(value) * 10**9 + round(value % 1.0 * 1e9) for value in time.tolist()], columns


def _register(writer: Any, topic: str, columns: Mapping[str, Any], units: Mapping[str, str], source: str) -> int:
    """Register the channel of a topic, with a schema that has each column's unit."""
    properties = {
        name: {"type": "number", **({"description": units[name]} if name in units else {})} for name in columns
    }
    name = f"jaxveh.{topic.strip('/').replace('/', '.')}"
    schema = {"title": name, "type": "object", "properties": properties}
    known = writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
    return writer.register_channel(topic, "json", known, {"source": source} if source else {})


def _messages(
    stamps: list[int], columns: Mapping[str, np.ndarray], place: int, channel: int
) -> Iterator[tuple[int, int, int, int, bytes]]:
    """Yield per row: time stamp (ns), place of the topic (orders rows with equal time stamps), row, channel and message."""
    names = list(columns)
    # Numbers are written in the precision of their column: single precision stays short.
    values = [_plain(column) for column in columns.values()]
    for row, stamp in enumerate(stamps):
        message = {name: text for name, column in zip(names, values, strict=True) if (text := column[row]) is not None}
        yield stamp, place, row, channel, _json(message)


def _plain(column: np.ndarray) -> list[str | None]:
    """Return numbers as JSON text, the shortest in the column's precision; None for numbers that are not finite."""
    # A type that NumPy does not have (bfloat16) writes minus zero as an integer, which has no sign.
    column = column.astype(np.float32) if column.dtype.kind == "V" else column
    finite = np.isfinite(column)
    return [str(value) if known else None for value, known in zip(column, finite, strict=True)]


def _json(message: Mapping[str, str]) -> bytes:
    return ("{" + ",".join(f"{json.dumps(name)}:{text}" for name, text in message.items()) + "}").encode()
