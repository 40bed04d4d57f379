"""Recordings and estimates as pandas data frames."""

from __future__ import annotations

import os
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_has, word_for
from jaxveh._core.names import as_mapping
from jaxveh._core.recording import Recording, check_recording
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.log import numeric
from jaxveh.io.naming import split_unit
from jaxveh.io.optional import require
from jaxveh.io.recordings import write_columns
from jaxveh.io.stamps import seconds
from jaxveh.io.units import convert, is_unit


def to_frame(data: Any) -> Any:
    """Return a `pandas.DataFrame` with a column `time` and one per channel, T rows.

    `data`: a `Recording`, or anything with `time` (T,), `mean` and `std` (NamedTuples or mappings of (T,)), such as an
    estimate of `jaxveh.run`: then columns are `name` and `name_std`, a standard deviation beside each mean. Units are
    in `frame.attrs["units"]`, a recording's note in `frame.attrs["source"]`.

    **Raises** `InputError` for data of another kind, or fields that are not (T,).
    """
    pandas = require("pandas", "making a data frame")
    if isinstance(data, Recording):
        check_recording("to_frame", data)
        columns, units, source = dict(data.channels), dict(data.units), data.source
    else:
        columns, source = _estimate(data), ""
        units = {name: unit for name in columns if (unit := canonical_unit(name))}
    time = np.asarray(data.time)
    columns = {name: np.asarray(values) for name, values in columns.items()}
    for name, values in columns.items():
        if values.shape != time.shape:
            raise InputError(f"to_frame: {name} has shape {values.shape}; it must be that of time, {time.shape}.")
    frame = pandas.DataFrame({"time": time, **columns})
    frame.attrs.update(units=units, source=source)
    return frame


def from_frame(frame: Any) -> Recording:
    """Return the recording of a data frame of `to_frame`, or of any other frame: each column is a channel.

    A channel has the float type of its column, in half precision at the least; other types become floats. Time is the column
    `time`, otherwise the index: numbers are seconds, durations become seconds, and dates seconds since 1970. Units and note are
    those of `frame.attrs`; a column's name may be `name [unit]`, and a channel of `io.CANONICAL`
    is then converted to SI.

    **Raises** `InputError` for columns that are not numbers, duplicate names, and time that does not increase.
    """
    pandas = require("pandas", "reading a data frame")
    if not isinstance(frame, pandas.DataFrame):
        raise InputError(f"from_frame: {word_for(frame)}: must be a pandas.DataFrame.")
    names = [str(name) for name in frame.columns]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"from_frame: several columns are named {', '.join(map(repr, twice))}; rename them.")
    columns = {
        name: numeric(frame[key].to_numpy(), f"from_frame: column {name!r}")
        for name, key in zip(names, frame, strict=True)
        if name != "time"
    }
    if "time" in names:
        time = _time(frame["time"], "from_frame: column 'time'")
    else:
        time = _time(frame.index, "from_frame: the index, because there is no column `time`")
    told = frame.attrs.get("units", {})
    plain = {name: (name, told.get(name, "")) if name in told else split_unit(name) for name in columns}
    channels = {}
    for name, values in columns.items():
        channel, unit = plain[name]
        target = None if name in told or not is_unit(unit) else canonical_unit(channel)
        if target is not None:
            values, plain[name] = convert(values, unit, target, f"from_frame: {channel}"), (channel, target)
        channels[channel] = jnp.asarray(values)
    if len(channels) < len(columns):
        raise InputError("from_frame: several columns have the same name without their [unit]; rename them.")
    units = {**{name: unit for name, unit in plain.values() if unit}, **told}
    return Recording(np.asarray(time, np.float64), channels, units, str(frame.attrs.get("source", "")))


def _time(cells: Any, what: str) -> np.ndarray:
    """Return a column or an index of numbers, dates or durations in seconds."""
    if getattr(getattr(cells, "dt", cells), "tz", None) is not None:
        cells = cells.dt.tz_convert(None) if hasattr(cells, "dt") else cells.tz_convert(None)
    array = cells.to_numpy()
    stamps = seconds(array, what)
    return numeric(array, what) if stamps is None else stamps


def write_frame(frame: Any, path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write a data frame with a column `time` as `.csv`, `.parquet`, `.nc`, `.mf4` or `.mdf`, like `write_recording`.

    Units and note are those of `frame.attrs`, as `to_frame` sets them. **Raises** `InputError` like `write_recording`,
    and for a frame without `time` or with columns that are not numbers.
    """
    check_flags(overwrite=overwrite)
    check_has(
        "write_frame: frame",
        frame,
        ("columns", "attrs"),
        "io.to_frame makes a frame; a Recording is for write_recording.",
    )
    if "time" not in frame.columns:
        raise InputError(f"write_frame: no column `time`; there are: {', '.join(map(str, frame.columns))}.")
    columns = {str(name): numeric(frame[name].to_numpy(), f"write_frame: column {name!r}") for name in frame.columns}
    time = columns.pop("time")
    write_columns(path, time, columns, frame.attrs.get("units", {}), frame.attrs.get("source", ""), overwrite)


def _estimate(data: Any) -> dict[str, Any]:
    if not all(hasattr(data, name) for name in ("time", "mean", "std")):
        raise InputError(f"to_frame: {word_for(data)} has no time, mean and std; give a recording or an estimate.")
    mean, std = as_mapping(data.mean, "mean"), as_mapping(data.std, "std")
    columns = {}
    for name, values in mean.items():
        columns[name] = values
        if name in std:
            columns[f"{name}_std"] = std[name]
    return columns
