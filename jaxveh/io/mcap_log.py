"""MCAP for Foxglove and PlotJuggler: topics of JSON messages, each with a JSON schema, stamped with the log's time."""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.files import check_suffix, replacing_file
from jaxveh.io.log import numeric
from jaxveh.io.optional import require

MCAP_SUFFIX = ".mcap"
"""What an MCAP file's name ends in."""
LATEST = 2**63 / 1e9
"""s: the largest stamp."""


def write_topics(topics: Mapping[str, Any], path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write data frames as topics of an `.mcap` file, such as `/estimate`, `/log` and `/truth`, all or nothing.

    `topics`: name to a data frame with a column `time` (s, at least zero, strictly increasing) and columns of numbers, as
    `to_frame` makes them. A message a row: its JSON has a number a column, with none where it is not finite, and is stamped
    with the row's time in nanoseconds; messages of all topics stand in the order of time. The schema names each column's unit,
    of `frame.attrs["units"]`, in its `description`; `frame.attrs["source"]` is the channel's metadata `source`.

    **Raises** `InputError` for another suffix, no topic, a frame without `time` or with columns that are not numbers, times that
    cannot be stamped, or where the file exists and `overwrite` is False.
    """
    path = Path(path)
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
    """Stamps (T,) in nanoseconds, and columns (T,) by name."""
    if "time" not in frame.columns:
        raise InputError(f"{what}: no column `time`; there are: {', '.join(map(str, frame.columns))}.")
    columns = {str(name): numeric(frame[name].to_numpy(), f"{what}: column {name!r}") for name in frame.columns}
    time = np.asarray(columns.pop("time"), np.float64)
    wrong = ~((time >= 0) & (time < LATEST)) | np.r_[False, np.diff(time) <= 0]
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"{what}: time[{k}] = {time[k]}: stamps must be at least zero, and strictly increasing. Shift the log's time, or "
            "write another format."
        )
    # A product of large seconds would not be exact.
    return [int(value) * 10**9 + round(value % 1.0 * 1e9) for value in time.tolist()], columns


def _register(writer: Any, topic: str, columns: Mapping[str, Any], units: Mapping[str, str], source: str) -> int:
    """The channel of a topic, with a schema that has each column's unit."""
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
    """Each row's stamp (ns), the topic's place, which stands in for it among rows of one stamp, the row, channel and message."""
    names = list(columns)
    # A column's own precision: single stays as short as it is.
    values = [_plain(column) for column in columns.values()]
    for row, stamp in enumerate(stamps):
        message = {name: text for name, column in zip(names, values, strict=True) if (text := column[row]) is not None}
        yield stamp, place, row, channel, _json(message)


def _plain(column: np.ndarray) -> list[str | None]:
    """Numbers as JSON writes them, shortest in the column's own precision; None for what is not finite."""
    # What is not NumPy's own (bfloat16) writes minus zero as a whole number, which has no sign.
    column = column.astype(np.float32) if column.dtype.kind == "V" else column
    finite = np.isfinite(column)
    return [str(value) if known else None for value, known in zip(column, finite, strict=True)]


def _json(message: Mapping[str, str]) -> bytes:
    return ("{" + ",".join(f"{json.dumps(name)}:{text}" for name, text in message.items()) + "}").encode()
