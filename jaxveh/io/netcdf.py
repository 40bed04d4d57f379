"""NetCDF 4 through xarray and h5netcdf: results with every name, unit and type, and logs from other programs."""

from __future__ import annotations

import io as streams
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.labelled import TIME, Labelled, Variable
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.datasets import arrays_of_dataset, dataset_of
from jaxveh.io.log import TIME_NAMES, TableLog
from jaxveh.io.optional import quiet_finalizers, require
from jaxveh.io.units import is_unit

NAME, DTYPE, DIMS = "jaxveh_name", "jaxveh_dtype", "jaxveh_dims"
"""Attributes for names and types of variables, and names of dimensions, that the format does not allow."""

_PLAIN = re.compile(r"[A-Za-z_][\w.]*")
ENGINE = "h5netcdf"


def write_netcdf(path: Path, labelled: Labelled) -> None:
    """Write a result's dataset.

    Names that NetCDF does not allow are replaced, and half precision becomes single; attributes record both.
    """
    require("h5netcdf", "writing NetCDF")
    dataset = dataset_of(labelled)
    names = {name: f"v{k}" for k, name in enumerate(dataset.variables) if not _PLAIN.fullmatch(str(name))}
    for name in list(dataset.variables):
        values, attributes = dataset[name].values, dict(dataset[name].attrs)
        if name in names:
            attributes[NAME] = str(name)
        if (values.dtype.kind == "f" and values.dtype.itemsize == 2) or values.dtype.kind == "V":
            attributes[DTYPE] = values.dtype.name
            dataset[name] = (dataset[name].dims, values.astype(np.float32))
        dataset[name].attrs = attributes
    dims = {d: f"d{k}" for k, d in enumerate(dataset.sizes) if not _PLAIN.fullmatch(str(d)) and d not in names}
    if dims:
        dataset.attrs[DIMS] = json.dumps({new: str(old) for old, new in dims.items()})
    dataset = dataset.rename({**names, **dims})
    # xarray would write a fill value for missing data; there are no missing data.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    # Into memory first: HDF5 ends the process if the disk is full.
    content = streams.BytesIO()
    dataset.to_netcdf(content, engine=ENGINE, encoding=encoding)
    path.write_bytes(content.getvalue())


def read_netcdf(path: Path) -> Labelled:
    """Read a file of `write_netcdf`, or a dataset from another program. **Raises** `InputError` for a damaged file."""
    require("h5netcdf", "reading NetCDF")
    with quiet_finalizers():
        try:
            return _read(path)
        except InputError:
            raise
        except Exception as error:  # HDF5 raises any kind of error for a damaged block
            reason = str(error) or type(error).__name__
    raise InputError(f"{path}: is not a readable NetCDF 4 file ({reason}). Is the file damaged?")


def _read(path: Path) -> Labelled:
    xarray = require("xarray", "reading NetCDF")
    with xarray.open_dataset(path, engine=ENGINE, decode_times=False, mask_and_scale=False) as opened:
        dataset = opened.load()
    old = {name: one.attrs.pop(NAME) for name, one in dataset.variables.items() if NAME in one.attrs}
    dataset = dataset.rename({**old, **json.loads(dataset.attrs.pop(DIMS, "{}"))})
    labelled = arrays_of_dataset(dataset, str(path))
    return labelled._replace(
        variables=_typed(dataset, labelled.variables), coordinates=_typed(dataset, labelled.coordinates)
    )


def _typed(dataset: Any, variables: Mapping[str, Variable]) -> dict[str, Variable]:
    import ml_dtypes

    found = {}
    for name, one in variables.items():
        dtype = dataset[name].attrs.get(DTYPE)
        if dtype is not None:
            kind = np.dtype(getattr(ml_dtypes, dtype, dtype))
            one = one._replace(values=np.asarray(one.values).astype(kind))
        found[name] = one
    return found


def open_netcdf(path: Path, channels: ChannelMap | None) -> TableLog:
    """Open a NetCDF file as a log: its variables over the dimension of time, with their `units`; other variables are ignored."""
    labelled = read_netcdf(path)
    both = labelled.both
    named = channels.time.column if channels is not None and channels.time is not None else None
    time = named or next((name for wanted in TIME_NAMES for name in both if name.casefold() == wanted), TIME)
    dims = both[time].dims if time in both else (TIME,)
    columns = {name: one for name, one in both.items() if one.dims == dims and len(dims) == 1}
    units = {name: one.unit for name, one in columns.items() if is_unit(one.unit)}
    load = lambda name: columns[name].values
    log = TableLog(path, tuple(columns), load, units, labelled.source, channels)
    log.as_saved = labelled.kind == "Recording"
    return log


def write_recording_netcdf(
    path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str], note: str
) -> None:
    """Write columns over time, in the form of `Recording.to_xarray`."""
    variables = {name: Variable((TIME,), values, units.get(name, "")) for name, values in columns.items()}
    facts = {"units": dict(units), "time": [], "jax": False}
    write_netcdf(
        path, Labelled("Recording", variables, {TIME: Variable((TIME,), time, "s")}, tuple(columns), note, facts)
    )
