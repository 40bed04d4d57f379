"""Parquet through pyarrow: units in the fields' metadata, the source note in the table's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import ml_dtypes
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.log import TIME_NAMES, TableLog
from jaxveh.io.naming import split_unit
from jaxveh.io.optional import require

_INDEX = "__index_level_"
_UNIT = b"unit"
_UNITS = (_UNIT, b"units", b"Unit", b"Units")
_SOURCE = b"source"
_OWN, _DTYPE = b"jaxveh", b"dtype"
"""Metadata keys: one marks a file saved from a recording, the other has the type of a column that Parquet does not support."""


def open_parquet(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a Parquet file; a field's metadata `unit` is its unit, the table's `source` its note. Only used columns are loaded."""
    require("pyarrow", "reading Parquet")
    parquet = require("pyarrow.parquet", "reading Parquet")
    try:
        schema = parquet.read_schema(path)
        headings = [name for name in schema.names if not name.startswith(_INDEX)]
        index = _index(schema, headings) if channels is None or channels.time is None else None
        headings = headings if index is None else ["time", *headings]
        place = lambda name: schema.names.index(index if index is not None and name == "time" else name)
        units = {name: unit for name in headings if (unit := _unit(schema.field(place(name))))}
        note = (schema.metadata or {}).get(_SOURCE, b"").decode()
        told = {name: (schema.field(place(name)).metadata or {}).get(_DTYPE) for name in headings}
        odd = {name: ml_dtypes.bfloat16 for name, dtype in told.items() if dtype == b"bfloat16"}
    except Exception as error:  # pyarrow raises any kind of error for a damaged block
        raise InputError(f"{path}: is not a readable Parquet file ({error}).") from error

    def load(heading: str) -> np.ndarray:
        stored = schema.names[place(heading)]
        try:
            with parquet.ParquetFile(path) as file:
                values = file.read(columns=[stored]).column(stored).to_numpy()
            return values if heading not in odd else values.astype(odd[heading])
        except Exception as error:  # as above
            raise InputError(f"{path}: column {heading!r} cannot be read ({error}).") from error

    log = TableLog(path, headings, load, units, note, channels)
    log.as_saved = _OWN in (schema.metadata or {})
    return log


def write_parquet(
    path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str], note: str
) -> None:
    """Write columns in their own float precision, with units and note in the form that `open_parquet` reads."""
    arrow = require("pyarrow", "writing Parquet")
    parquet = require("pyarrow.parquet", "writing Parquet")
    arrays = {"time": time, **columns}
    metadata = {name: {_UNIT: unit} for name, unit in {"time": "s", **units}.items()}
    for name, values in columns.items():
        if values.dtype == ml_dtypes.bfloat16:
            metadata[name] = {**metadata.get(name, {}), _DTYPE: b"bfloat16"}
            arrays[name] = values.astype(np.float32)
    fields = [
        arrow.field(name, arrow.from_numpy_dtype(values.dtype), metadata=metadata.get(name))
        for name, values in arrays.items()
    ]
    schema = arrow.schema(fields, metadata={_OWN: b"Recording", **({_SOURCE: note} if note else {})})
    parquet.write_table(arrow.table([arrow.array(values) for values in arrays.values()], schema=schema), path)


def _index(schema: Any, headings: list[str]) -> str | None:
    """Return the column of an index of pandas without a name, if it is the only time: floats, dates or durations."""
    arrow = require("pyarrow", "reading Parquet")
    if any(split_unit(name)[0].casefold() in TIME_NAMES for name in headings):
        return None
    is_time = (arrow.types.is_floating, arrow.types.is_timestamp, arrow.types.is_duration)
    found = [
        name for name in schema.names if name.startswith(_INDEX) and any(of(schema.field(name).type) for of in is_time)
    ]
    return found[0] if len(found) == 1 else None


def _unit(field) -> str:
    metadata = field.metadata or {}
    return next((metadata[key].decode() for key in _UNITS if key in metadata), "")
