"""MATLAB's `.mat` files as logs: vectors beside a time vector, structs with `Time` and `Data`, Simulink's structure with time,
ControlDesk's axes and traces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.channel_map import Channel, ChannelMap
from jaxveh.io.control_desk import traces_of
from jaxveh.io.log import TIME_NAMES, apply, check_ending
from jaxveh.io.mat_elements import Unread
from jaxveh.io.mat_file import read_mat
from jaxveh.io.naming import check_known
from jaxveh.io.nested_log import Leaf, NestedLog, in_words
from jaxveh.io.units import convert, is_unit

DATA_NAMES = ("data", "values", "value", "signals")
UNIT_NAMES = ("units", "unit")
NAME_NAMES = ("label", "name")
WIDEST = 64
"""Largest number of columns into which a matrix is split."""

_SECONDS = {"seconds": "s", "milliseconds": "ms", "microseconds": "us", "minutes": "min", "hours": "h"}


class Clocks(NamedTuple):
    """The path of the time that the channel map names ("" for none), and a function that converts a struct's time to seconds."""

    named: str
    in_seconds: Callable[[np.ndarray, Mapping[str, Any]], np.ndarray]


def open_mat(path: Path, channels: ChannelMap | None) -> NestedLog:
    """Open a `.mat` file of version 5 or 7.3.

    A time vector in a struct (`time`, `Time`, `t`, ...) belongs to the columns beside it, and to those of the same length in
    structs below it. `Data` or `values` have the name of their struct; a matrix is split into `name[0]`, `name[1]`, .... The
    `time` of the channel map is the time of all columns of the same length that have no time vector of their own; its unit holds
    for all time vectors.

    **Raises** `InputError` for a file in which no vector belongs to a time vector, with a list of its contents.
    """
    content = read_mat(path)
    found, seen = {}, {}
    time, clocks = None, Clocks("", _in_seconds)
    if channels is not None and (named := channels.time) is not None:
        time, place = _named_time(path, content, named)
        clocks = Clocks(
            place, lambda own, node: _stamps(path, named, own) if is_unit(named.unit) else _in_seconds(own, node)
        )
    for leaf in _leaves(content, "", "", time, clocks, seen):
        found.setdefault(leaf.path, leaf)
    leaves = [leaf for leaf in found.values() if leaf.path not in {one for one, what in seen.items() if what == "time"}]
    objects = {name: what for name, what in seen.items() if what not in ("time", "")}
    if not leaves:
        raise InputError(
            f"{path}: no vector belongs to a time vector ({', '.join(TIME_NAMES)}); found: {in_words(objects)}. "
            'Name the time in a channel map: time = "COLUMN". Save the rows of a matrix as vectors with names. Only MATLAB can '
            "read objects (timeseries, Dataset, timetable): "
            "save their fields, such as log.v_x.Time and log.v_x.Data."
        )
    return NestedLog(path, leaves, without=f"Not read: {in_words(objects)}." if objects else "")


def _leaves(
    node: Any, path: str, short: str, time: np.ndarray | None, clocks: Clocks, seen: dict[str, str], unit: str = ""
) -> Iterator[Leaf]:
    """Yield the columns in the part of the file at `path`, below a time vector; everything else is added to `seen`."""
    if isinstance(node, Mapping):
        yield from _of_struct(node, path, short, time, clocks, seen)
    elif isinstance(node, list) and any(isinstance(one, Mapping) for one in node):
        for k, one in enumerate(node):
            name = _text(one, NAME_NAMES) or f"{short}[{k}]" if isinstance(one, Mapping) else f"{short}[{k}]"
            yield from _leaves(one, f"{path}[{k}]", name, time, clocks, seen)
    elif isinstance(node, np.ndarray):
        columns = None if time is None else _columns(node, len(time))
        if columns is None or time is None:
            seen[path] = "x".join(map(str, node.shape))
            return
        for k, values in enumerate(columns):
            index = f"[{k}]" if len(columns) > 1 else ""
            yield Leaf(path + index, short + index, time, values, unit)
    elif isinstance(node, Unread):
        seen[path] = node.what


def _of_struct(
    node: Mapping[str, Any], path: str, short: str, time: np.ndarray | None, clocks: Clocks, seen: dict[str, str]
) -> Iterator[Leaf]:
    below = lambda name: f"{path}.{name}" if path else name
    if not clocks.named and (traces := traces_of(node)) is not None:
        for axis, clock, number, trace in traces:
            if (own := _vector(clock["Data"])) is not None:
                seen[f"{below('X')}[{axis}].Data"] = "time"
                place, called = f"{below('Y')}[{number}]", _text(trace, NAME_NAMES).strip('"') or f"Y[{number}]"
                seconds = convert(own, unit, "s", place) if is_unit(unit := _text(clock, UNIT_NAMES)) else own
                yield from _leaves(trace["Data"], place, called, seconds, clocks, seen, _text(trace, UNIT_NAMES))
        return
    name = next((one for wanted in TIME_NAMES for one in node if one.casefold() == wanted), None)
    own = None if name is None or (clocks.named and not path) else _vector(node[name])
    if own is not None and name is not None:
        time = time if below(name) == clocks.named else clocks.in_seconds(own, node)
        seen[below(name)] = "time"
    unit = _text(node, UNIT_NAMES) or _text(node.get("DataInfo"), UNIT_NAMES)
    for key, value in node.items():
        if key == name and own is not None:
            continue
        # `log.vx.Data` is named `log.vx`, and the contents of `scope.signals` are named as those of `scope`.
        is_data = bool(path) and key.casefold() in DATA_NAMES and time is not None
        at, called = (path, short) if is_data else (below(key), key)
        yield from _leaves(value, at, called, time, clocks, seen, unit if is_data else "")


def _named_time(path: Path, content: Mapping[str, Any], named: Channel) -> tuple[np.ndarray, str]:
    """Return the vector that the channel map names as time, in seconds, and its path in the file."""
    vectors = dict(_vectors(content, ""))
    shorts = [one.rpartition(".")[2] for one in vectors]
    places = {one.rpartition(".")[2]: one for one in vectors if shorts.count(one.rpartition(".")[2]) == 1}
    places |= {one: one for one in vectors}
    check_known(str(path), "vector", named.column, places, "It is the `time` of the channel map.")
    place = places[named.column]
    return _stamps(path, named, vectors[place]), place


def _stamps(path: Path, named: Channel, values: np.ndarray) -> np.ndarray:
    """Convert times to seconds, with the unit of the channel map."""
    check_ending(f"{path}: {named.column}", named, named.unit, "s")
    stamps = apply(named, values)
    return convert(stamps, named.unit, "s", f"{path}: {named.column}") if is_unit(named.unit) else stamps


def _vectors(node: Any, path: str) -> Iterator[tuple[str, np.ndarray]]:
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _vectors(value, f"{path}.{key}" if path else key)
    elif isinstance(node, np.ndarray) and (vector := _vector(node)) is not None:
        yield path, vector


def _vector(value: Any) -> np.ndarray | None:
    """Return an array of numbers with one long side as (n,); None for anything else."""
    numbers = isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size > 0
    if not numbers or max(value.shape) != value.size:
        return None
    return np.ascontiguousarray(value.ravel(), np.float64)


def _columns(values: np.ndarray, rows: int) -> list[np.ndarray] | None:
    """Return the columns (rows,) of an array with time along one side; None if no side fits, or it has no numbers."""
    if values.dtype.kind not in "fiub" or values.size == 0:
        return None
    if (vector := values.ravel()).size == rows:
        return [vector]
    shape = tuple(side for side in values.shape if side > 1)
    if rows not in shape or values.size // rows > WIDEST:
        return None
    # Simulink has time last if a sample is a matrix, and first if it is a vector.
    along = 0 if shape[0] == rows else len(shape) - 1
    if shape[along] != rows:
        return None
    table = np.moveaxis(values.reshape(shape), along, 0).reshape(rows, -1)
    return list(np.ascontiguousarray(table.T))


def _in_seconds(time: np.ndarray, node: Mapping[str, Any]) -> np.ndarray:
    """Convert time to seconds, with the unit of a timeseries' `TimeInfo`."""
    unit = _text(node.get("TimeInfo"), UNIT_NAMES)
    unit = _SECONDS.get(unit, unit)
    return convert(time, unit, "s", "TimeInfo") if is_unit(unit) else time


def _text(node: Any, names: tuple[str, ...]) -> str:
    """Return the text of the first of these fields that has one; "" if none has."""
    if not isinstance(node, Mapping):
        return ""
    folded = {key.casefold(): value for key, value in node.items()}
    return next(
        (folded[name].strip() for name in names if isinstance(folded.get(name), str) and folded[name].strip()), ""
    )
