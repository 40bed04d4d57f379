"""Reading and writing of recordings: CSV, Parquet, MDF4, NetCDF; MATLAB, MCAP and VBOX for reading."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_flags, path_of, warn
from jaxveh._core.recording import Recording, check_recording
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.channel_map import Channel, ChannelMap, read_channel_map
from jaxveh.io.csv_log import open_csv, write_csv
from jaxveh.io.files import check_readable, check_suffix, replacing_file
from jaxveh.io.folder_log import FolderLog
from jaxveh.io.likely_names import MOST_LIKELY, likely_names
from jaxveh.io.log import Column, Log, apply, check_ending
from jaxveh.io.mat_log import open_mat
from jaxveh.io.mcap_reader import open_mcap
from jaxveh.io.mdf_log import open_mdf, write_mdf
from jaxveh.io.merge import merge, resample
from jaxveh.io.netcdf import open_netcdf, write_recording_netcdf
from jaxveh.io.parquet_log import open_parquet, write_parquet
from jaxveh.io.repeats import without_repeats
from jaxveh.io.units import convert, is_unit
from jaxveh.io.vbo import open_vbo


def open_dat(path: Path, channels: ChannelMap | None) -> Log:
    """Open a `.dat` file, which is MDF of version 3 (as INCA writes it) or text."""
    with path.open("rb") as file:
        is_mdf = file.read(3) == b"MDF"
    return open_mdf(path, channels) if is_mdf else open_csv(path, channels)


_DECODE = "decode it with its DBC file into MDF4 (asammdf's extract_bus_logging)"
_BUS_FRAME = re.compile(rb"\s*\(\d+\.\d+\)\s+\w+\s+[0-9A-Fa-f]+(#|\s+\[\d+\])")
"""A line of can-utils: `(1631416514.717133) can0 0D2#0000FFFF`."""


def open_text_log(path: Path, channels: ChannelMap | None) -> Log:
    """Open a `.log` file, which is a table of text (RaceCapture) or a trace of a CAN bus, which is not read."""
    with path.open("rb") as file:
        frames = _BUS_FRAME.match(file.read(200)) is not None
    if frames:
        raise InputError(f"{path}: holds the frames of a CAN bus: {_DECODE}.")
    return open_csv(path, channels)


_OPEN: dict[str, Callable[[Path, ChannelMap | None], Log]] = {
    ".csv": open_csv,
    ".parquet": open_parquet,
    ".mf4": open_mdf,
    ".mdf": open_mdf,
    ".mat": open_mat,
    ".mcap": open_mcap,
    ".nc": open_netcdf,
    ".vbo": open_vbo,
    ".txt": open_csv,
    ".tsv": open_csv,
    ".dat": open_dat,
    ".log": open_text_log,
}
_WRITE = {
    ".csv": write_csv,
    ".parquet": write_parquet,
    ".mf4": write_mdf,
    ".mdf": write_mdf,
    ".nc": write_recording_netcdf,
}
_ELSEWHERE = {
    ".xlsx": "save the sheet as CSV",
    ".xls": "save the sheet as CSV",
    ".ld": "export it as CSV from MoTeC i2",
    ".xrk": "export it as CSV from AiM's Race Studio",
    ".blf": _DECODE,
    ".asc": _DECODE,
    ".trc": _DECODE,
    ".bag": "convert it to MCAP (`mcap convert`)",
    ".db3": "convert it to MCAP (`mcap convert`)",
    ".can": _DECODE,
    ".ibt": "export it as CSV, with its units",
    ".erg": "export it as CSV or MATLAB from CarMaker's IPGControl",
    ".vs": "export it as CSV or MATLAB from CarSim's plotter",
    ".erd": "export it as CSV or MATLAB from CarSim's plotter",
    ".tdms": "load its channels and make a `jaxveh.Recording`, or write Parquet",
    ".json": "write its arrays as CSV or Parquet",
    ".npy": "load its arrays and make a `jaxveh.Recording`",
    ".npz": "load its arrays and make a `jaxveh.Recording`",
    ".gz": "unpack it first",
    ".zip": "unpack it first",
    ".xdrk": "export it as CSV from AiM's Race Studio",
    ".mlg": "export it as CSV from MegaLogViewer",
    ".llg": "export it as CSV from Link's PCLink",
    ".feather": "save it as Parquet (`pandas.read_feather`, then `to_parquet`)",
    ".pkl": "save it as Parquet (`to_parquet`)",
    ".h5": "load its arrays and make a `jaxveh.Recording`, or write MATLAB 7.3, NetCDF or Parquet",
    ".hdf5": "load its arrays and make a `jaxveh.Recording`, or write MATLAB 7.3, NetCDF or Parquet",
}
"""What to do with logs that are not read, by the ending of their names."""

SUFFIXES = tuple(_WRITE)
"""File name endings that are read and written."""
LOG_SUFFIXES = tuple(_OPEN)
"""File name endings that are read."""
FEW = 0.2
"""The share of rows with the time of the row before, above which the clock stands still."""
MOST_OTHERS = 8
"""The number of columns that were left out which a warning names, beside the first."""


def read_recording(
    path: str | os.PathLike,
    channels: ChannelMap | str | os.PathLike | None = None,
    *,
    raster: str | None = None,
    method: str = "linear",
) -> Recording:
    """Read a log: text (`.csv`, `.txt`, `.tsv`, `.dat`, `.log`), `.parquet`, `.mf4` or `.mdf` (also as `.dat`), MATLAB's `.mat`
    (structs included), `.mcap` (topics of JSON messages), NetCDF 4 (`.nc`), a VBOX's `.vbo`, or a folder with a file for each
    message or device.

    **Arguments**: `channels`: a channel map or the path of one (see `io.channel_map.CHANNEL_MAP_SCHEMA`); without it every column
    is a channel with its own name, and time is the column `time`, `timestamps`, `timestamp` or `t`, or two with seconds and
    nanoseconds (header.stamp.secs and header.stamp.nsecs); columns that are no numbers are left out with a warning, unless
    they have the name of a known channel. `raster`: the name of a channel whose samples become the rows; the others are filled
    there by `method` (`linear`, `hold`; `io.resample`).

    **Units**: those of the channel map, otherwise those of the file (Parquet: the field's metadata `unit`; MDF4: the channel's
    unit; MATLAB: `Units` beside the data; text: a line of units below the names; text and Parquet: `name [unit]` or
    `name (unit)`), otherwise SI. Channels of `io.CANONICAL` are converted to SI; other channels keep their unit.

    **Time base**: MDF4 groups, MATLAB structs, MCAP topics and the files of a folder are merged, not resampled: a row for every
    time stamp, NaN where a sensor has no sample. Time stamps keep the log's own time, in seconds, on the host in float64;
    channels have JAX's float type. Dates become seconds since 1970, times of day seconds.

    **VBOX**: the standard channels become `speed`, `course`, `z`, `climb_rate`, and `x` (east) and `y` (north) of the first fix;
    they are NaN in rows without a satellite.

    **Text** may have lines above the names of the columns, a line of units below them, `,`, `;`, tabs, `|` or blanks between
    cells, and decimal commas; it may be an export of Haltech's NSP, or a RaceCapture's log. What was assumed (lines above that
    are not read, an encoding) is told in a `JaxvehWarning`.

    **Raises** `InputError` naming file, column, row, value and remedy: a missing file, an unknown suffix, a broken file, an
    empty log, an unknown column, a unit of another dimension, a cell that is not a number, time that does not increase.
    """
    return _read(path, channels, raster, method, as_saved=False)


def load_recording(path: str | os.PathLike) -> Recording:
    """Read a log like `read_recording`; in a file saved from a recording the channels keep their float types."""
    return _read(path, None, None, "linear", as_saved=True)


def _read(
    path: str | os.PathLike,
    channels: ChannelMap | str | os.PathLike | None,
    raster: str | None,
    method: str,
    as_saved: bool,
) -> Recording:
    path = path_of(path)
    if (advice := _ELSEWHERE.get(path.suffix.lower())) is not None:
        raise InputError(
            f"{path}: suffix {path.suffix!r} is not read: {advice}; a log must end in one of {', '.join(_OPEN)}."
        )
    suffix = "" if path.is_dir() else check_suffix(path, _OPEN, "log")
    if suffix:
        check_readable(path)
    chosen = channels if isinstance(channels, ChannelMap) or channels is None else read_channel_map(channels)
    with contextlib.closing(_OPEN[suffix](path, chosen) if suffix else FolderLog(path, chosen, _OPEN)) as log:
        as_saved = as_saved and log.as_saved
        if as_saved:
            loaded = {name: log.column(name) for name in log.names}
        elif chosen and chosen.channels:
            loaded = {name: _load(log, name, channel) for name, channel in chosen.channels.items()}
        else:
            loaded = _load_all(log)
        if not loaded:
            raise InputError(f"{path}: has no channel except time.")
        note = log.note if as_saved else log.note or path.name
    time, values = _joined(path, *merge(loaded), chosen.repeats if chosen else None)
    if as_saved:
        # A recording leaves arrays of JAX unchanged; those of NumPy get JAX's current float type.
        values = {name: jnp.asarray(one) for name, one in values.items()}
    units = {name: column.unit for name, column in loaded.items() if column.unit}
    try:
        recording = Recording(time, values, units, note)
        return recording if raster is None else resample(recording, raster, method)
    except InputError as error:
        told = chosen is not None and chosen.time is not None
        others = [] if told or np.all(np.diff(time) > 0) else likely_names("time", log.names)[:MOST_LIKELY]
        other = f' Or is {", ".join(others)} the time? Name it in a channel map: time = "COLUMN".' if others else ""
        again = ' Or take one of such rows: repeats = "last" in a channel map, above its tables.' * _few_repeats(time)
        raise InputError(f"{path}: {error}{again}{other}") from error


def _few_repeats(time: np.ndarray) -> bool:
    """Whether few of the time stamps (T,) are those of the row before, and none is earlier."""
    steps = np.diff(time)
    return bool(0 < np.sum(steps == 0) < FEW * steps.size and np.all(steps >= 0))


def _joined(
    path: Path, time: np.ndarray, values: dict[str, np.ndarray], counts: str | None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Join rows with the same time stamp, with a warning: where none contradicts another, or the map says which counts."""
    steps = np.diff(time)
    repeats = int(np.sum(steps == 0))
    if not repeats or np.any(steps < 0):
        return time, values
    story = f"{path}: {repeats} row{'s have' if repeats > 1 else ' has'} the time of the row before"
    if (joined := without_repeats(time, values)) is not None:
        warn(f"{story} and no other values: joined with it.")
        return joined
    chosen = without_repeats(time, values, counts) if counts else None
    if chosen is None:
        return time, values
    warn(f"{story} and other values: of each column the {counts} counts.")
    return chosen


def write_recording(recording: Recording, path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write a recording as `.csv`, `.parquet`, `.mf4`, `.mdf` or `.nc`, which `read_recording` reads back.

    Every format keeps values and time bit for bit; Parquet, MDF4 and NetCDF keep units and source note. CSV has no place for
    them: if units are not SI, or for other readers, write `with_units_in_names(recording)`. `Recording.load` restores the float
    types of channels from Parquet and NetCDF.

    The file is written completely or not at all. **Raises** `InputError` for another suffix, or if the file exists and
    `overwrite` is False.
    """
    check_flags(overwrite=overwrite)
    check_recording("write_recording", recording)
    columns = {name: np.asarray(values) for name, values in recording.channels.items()}
    write_columns(path, np.asarray(recording.time), columns, dict(recording.units), recording.source, overwrite)


def with_units_in_names(recording: Recording) -> Recording:
    """Return a copy whose channels are named `name [unit]`, for CSV files for other programs; reading removes the units."""
    check_recording("with_units_in_names", recording)
    units = {name: recording.unit(name) for name in recording.names}
    names = {name: f"{name} [{unit}]" if is_unit(unit) else name for name, unit in units.items()}
    channels = {names[name]: values for name, values in recording.channels.items()}
    known = {names[name]: unit for name, unit in units.items() if is_unit(unit)}
    return Recording(recording.time, channels, known, recording.source)


def write_columns(
    path: str | os.PathLike,
    time: np.ndarray,
    columns: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    note: str,
    overwrite: bool,
) -> None:
    """Write columns (T,) over `time` (T,) in the format of the suffix, completely or not at all."""
    path = path_of(path)
    suffix = check_suffix(path, _WRITE, "recording")
    if "time" in columns:
        raise InputError(f"{path}: a channel is named `time`, which is the name of the time column; rename it.")
    with replacing_file(path, overwrite) as part:
        _WRITE[suffix](part, np.asarray(time, dtype=np.float64), columns, units, note)


def _load_all(log: Log) -> dict[str, Column]:
    """Load every column by its own name, without those that are no channels: texts, dates, names that are there twice.

    A `JaxvehWarning` names them. **Raises** `InputError` for a known channel that cannot be read, and if no column can be.
    """
    loaded, left = {}, {}
    for name in log.names:
        try:
            loaded[name] = _load(log, name, Channel(name))
        except InputError as error:
            if canonical_unit(name) is not None:
                raise
            left[name] = error
    if left and not loaded:
        raise next(iter(left.values()))
    if left:
        first, *more = left
        names = f"{first!r}" + (f", and {len(more)} more ({', '.join(more[:MOST_OTHERS])})" if more else "")
        warn(f"left out {names}: {left[first]}")
    return loaded


def _load(log: Log, name: str, channel: Channel) -> Column:
    own = channel.time
    column = log.column(channel.column, channel.group) if own is None else log.column_over(channel.column, own)
    values, target = apply(channel, column.values), canonical_unit(name)
    unit = channel.unit if is_unit(channel.unit) else column.unit
    what = f"{log.path}: {name}" + (f" (column {channel.column!r})" if channel.column != name else "")
    if target is None:
        return Column(column.time, values, unit if is_unit(unit) else "")
    check_ending(what, channel, unit, target)
    return Column(column.time, convert(values, unit, target, what) if is_unit(unit) else values, target)
