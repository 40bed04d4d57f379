"""A whole result in one Parquet table: rows along its longest dimension, a column for each place along the others."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.labelled import Labelled, Variable
from jaxveh.io.datasets import arrays_of_text, facts_as_text
from jaxveh.io.optional import require

_TOLD, _PLACES, _SOURCE, _UNIT = b"jaxveh", b"jaxveh_places", b"source", b"unit"
MOST_COLUMNS = 4096
MOST_BESIDE = 2**22
"""Largest size of the values without rows, which are stored in the file's metadata, bytes."""


def write_wide(path: Path, labelled: Labelled) -> None:
    """Write a result; **raises** `InputError` if it would have too many columns."""
    arrow = require("pyarrow", "writing Parquet")
    parquet = require("pyarrow.parquet", "writing Parquet")
    along = _longest(labelled)
    arrays, fields, places = [], [], {}
    for name, one in labelled.both.items():
        values = np.asarray(one.values)
        place: dict[str, Any] = {"dims": one.dims, "dtype": values.dtype.name, "shape": values.shape, "unit": one.unit}
        place["coordinate"] = name in labelled.coordinates
        if along in one.dims:
            place["along"] = k = one.dims.index(along)
            flat = _stored(np.moveaxis(values, k, 0).reshape(values.shape[k], -1))
            place["columns"] = [name if flat.shape[1] == 1 else f"{name}[{k}]" for k in range(flat.shape[1])]
            metadata = {_UNIT: one.unit} if one.unit else None
            for k, column in enumerate(place["columns"]):
                made = arrow.array(flat[:, k].tolist() if flat.dtype.kind == "O" else np.ascontiguousarray(flat[:, k]))
                arrays.append(made)
                fields.append(arrow.field(column, made.type, metadata=metadata))
        else:
            place["values"] = _text(values)
        places[name] = place
    if len(fields) > MOST_COLUMNS or sum(len(str(one.get("values", ""))) for one in places.values()) > MOST_BESIDE:
        raise InputError(
            f"{path}: a {labelled.kind} of this size does not fit into a table: along {along} it has {len(fields)} columns, and "
            f"further values; at most {MOST_COLUMNS} columns are written. Write .nc."
        )
    names = [field.name for field in fields]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two columns would have the same name. Write .nc.")
    metadata = {_TOLD: facts_as_text(labelled), _PLACES: json.dumps(places), _SOURCE: labelled.source}
    parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields, metadata=metadata)), path)


def read_wide(path: Path) -> Labelled:
    """Read a file of `write_wide`; any other Parquet file gives an empty result. **Raises** `InputError` for a damaged file."""
    require("pyarrow", "reading Parquet")
    parquet = require("pyarrow.parquet", "reading Parquet")
    try:
        with parquet.ParquetFile(path) as file:
            metadata = file.schema_arrow.metadata or {}
            if _TOLD not in metadata or _PLACES not in metadata:
                return Labelled("", {}, {}, ())
            table = file.read()
        source = metadata.get(_SOURCE, b"").decode()
        variables: dict[str, Variable] = {}
        coordinates: dict[str, Variable] = {}
        for name, place in json.loads(metadata[_PLACES]).items():
            found = Variable(tuple(place["dims"]), _values(table, place), place["unit"])
            (coordinates if place["coordinate"] else variables)[name] = found
        return arrays_of_text(metadata[_TOLD].decode(), variables, coordinates, source, str(path))
    except InputError:
        raise
    except Exception as error:  # pyarrow raises any kind of error for a damaged block
        reason = str(error) or type(error).__name__
        raise InputError(f"{path}: is not a readable Parquet file ({reason}). Is the file damaged?") from error


def _values(table: Any, place: dict[str, Any]) -> np.ndarray:
    import ml_dtypes

    dtype = np.dtype(object if place["dtype"] == "object" else getattr(ml_dtypes, place["dtype"], place["dtype"]))
    shape = tuple(place["shape"])
    if "values" in place:
        return _of_text(place["values"], dtype, shape)
    along = place["along"]
    columns = [table.column(column).to_numpy(zero_copy_only=False) for column in place["columns"]]
    rest = [n for k, n in enumerate(shape) if k != along]
    flat = np.stack([np.asarray(column) for column in columns], axis=-1).astype(dtype)
    return np.ascontiguousarray(np.moveaxis(flat.reshape(len(table), *rest), 0, along))


def _longest(labelled: Labelled) -> str:
    sizes = {d: n for one in labelled.both.values() for d, n in zip(one.dims, np.shape(one.values), strict=True)}
    if not sizes:
        raise InputError(f"a {labelled.kind} without dimensions does not fit into a table. Write .nc.")
    return max(sizes, key=lambda d: sizes[d])


def _stored(values: np.ndarray) -> np.ndarray:
    """Return values of a type that Parquet has."""
    return values.astype(np.float32) if values.dtype.kind == "V" else values


def _text(values: np.ndarray) -> Any:
    return (
        values.tolist()
        if values.dtype.kind == "O"
        else base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
    )


def _of_text(text: Any, dtype: np.dtype, shape: tuple[int, ...]) -> np.ndarray:
    if dtype.kind == "O":
        return np.array(text, object).reshape(shape)
    return np.frombuffer(base64.b64decode(text), dtype).reshape(shape).copy()
