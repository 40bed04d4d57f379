"""Results in files: NetCDF through xarray, and Parquet through pyarrow; both keep all values to the last bit."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jaxveh._core.errors import check_flags, path_of
from jaxveh._core.labelled import Labelled
from jaxveh._core.recording import Recording
from jaxveh.io.datasets import result_of
from jaxveh.io.files import check_readable, check_suffix, replacing_file
from jaxveh.io.netcdf import read_netcdf, write_netcdf
from jaxveh.io.recordings import load_recording, write_recording
from jaxveh.io.wide_parquet import read_wide, write_wide

_READ: dict[str, Callable[[Path], Labelled]] = {".nc": read_netcdf, ".parquet": read_wide}
_WRITE: dict[str, Callable[[Path, Labelled], None]] = {".nc": write_netcdf, ".parquet": write_wide}
RESULT_SUFFIXES = tuple(_WRITE)
"""Endings of files that can contain a whole result."""


def save_result(result: Any, path: str | os.PathLike, overwrite: bool = False) -> None:
    """Write a result as `.nc` or `.parquet`, completely or not at all; a recording in any format of `write_recording`."""
    check_flags(overwrite=overwrite)
    path = path_of(path)
    if isinstance(result, Recording) and result.time.ndim == 1:
        write_recording(result, path, overwrite=overwrite)
        return
    suffix = check_suffix(path, _WRITE, f"file of {type(result).__name__}")
    with replacing_file(path, overwrite) as part:
        _WRITE[suffix](part, result._labelled())


def load_result(kind: type, path: str | os.PathLike) -> Any:
    """Read a result of a kind that `save_result` wrote; a recording from any log that `read_recording` reads."""
    path = path_of(path)
    if kind is Recording and path.suffix.lower() not in _READ:
        return load_recording(path)
    suffix = check_suffix(path, _READ, f"file of {kind.__name__}")
    check_readable(path)
    labelled = _READ[suffix](path)
    return load_recording(path) if kind is Recording and not labelled.kind else result_of(kind, labelled, str(path))
