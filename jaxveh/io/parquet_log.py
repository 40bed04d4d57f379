"""Parquet through pyarrow: units in the fields' metadata, the source note in the table's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import ml_dtypes
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.log import TableLog
from jaxveh.io.optional import require

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
        headings = [name for name in schema.names if not name.startswith("__index_level_")]
        units = {name: unit for name in headings if (unit := _unit(schema.field(schema.names.index(name))))}
        note = (schema.metadata or {}).get(_SOURCE, b"").decode()
        told = {name: (schema.field(schema.names.index(name)).metadata or {}).get(_DTYPE) for name in headings}
        odd = {name: ml_dtypes.bfloat16 for name, dtype in told.items() if dtype == b"bfloat16"}
    except Exception as error:  # pyarrow raises any kind of error for a damaged block
        raise InputError(f"{path}: is not a readable Parquet file ({error}).") from error
    twice = sorted({name for name in headings if headings.count(name) > 1})
    if twice:
        raise InputError(f"{path}: several columns are named {', '.join(map(repr, twice))}; rename them.")

    def load(heading: str) -> np.ndarray:
        try:
            with parquet.ParquetFile(path) as file:
                values = file.read(columns=[heading]).column(heading).to_numpy()
            return values if heading not in odd else values.astype(odd[heading])
        except Exception as error:  # as above
            raise InputError(f"{path}: column {heading!r} cannot be read ({error}).") from error

    log = TableLog(path, headings, load, units, note, channels.time if channels else None)
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


def _unit(field) -> str:
    metadata = field.metadata or {}
    return next((metadata[key].decode() for key in _UNITS if key in metadata), "")
