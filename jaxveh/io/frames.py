"""Recordings and estimates as pandas data frames."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_mapping
from jaxveh._core.recording import Recording
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.log import numeric
from jaxveh.io.optional import require
from jaxveh.io.recordings import write_columns


def to_frame(data: Any) -> Any:
    """A `pandas.DataFrame` with a column `time` and one a channel, T rows.

    `data`: a `Recording`, or anything with `time` (T,), `mean` and `std` (NamedTuples or mappings of (T,)), as an
    estimate of `jaxveh.run`: then columns are `name` and `name_std`, a standard deviation beside each mean. Units are
    in `frame.attrs["units"]`, a recording's note in `frame.attrs["source"]`.

    **Raises** `InputError` for data of another kind, or fields that are not (T,).
    """
    pandas = require("pandas", "making a data frame")
    if isinstance(data, Recording):
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


def write_frame(frame: Any, path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write a data frame with a column `time` as `.csv`, `.parquet`, `.mf4` or `.mdf`, as `write_recording` does.

    Units and note are those of `frame.attrs`, as `to_frame` sets them. **Raises** `InputError` as `write_recording`,
    and for a frame without `time` or with columns that are not numbers.
    """
    if "time" not in frame.columns:
        raise InputError(f"write_frame: no column `time`; there are: {', '.join(map(str, frame.columns))}.")
    columns = {str(name): numeric(frame[name].to_numpy(), f"write_frame: column {name!r}") for name in frame.columns}
    time = columns.pop("time")
    write_columns(path, time, columns, frame.attrs.get("units", {}), frame.attrs.get("source", ""), overwrite)


def _estimate(data: Any) -> dict[str, Any]:
    if not all(hasattr(data, name) for name in ("time", "mean", "std")):
        raise InputError(f"to_frame: {type(data).__name__} has no time, mean and std; give a recording or an estimate.")
    mean, std = as_mapping(data.mean, "mean"), as_mapping(data.std, "std")
    columns = {}
    for name, values in mean.items():
        columns[name] = values
        if name in std:
            columns[f"{name}_std"] = std[name]
    return columns
