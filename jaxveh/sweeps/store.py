"""A sweep's Zarr store: one array for each value, with the design's names, which xarray opens directly.

A chunk's values are written first and its mark in `chunk_status` last; each file is written beside its place and then moved
there. A marked chunk is therefore complete, whenever a process was killed; a chunk without a mark is computed again.
"""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, path_of
from jaxveh.io import kit
from jaxveh.sweeps.design import Axis, Design
from jaxveh.sweeps.plan import Chunk, Plan
from jaxveh.sweeps.swept import OWN, SEED

MANIFEST = "jaxveh_sweep"
"""The attribute with the sweep's identity."""

ABOUT = "jaxveh_about"
"""The attribute with the units and the note."""

STATUS, ERROR = "chunk_status", "chunk_error"
NOT_DONE, DONE, FAILED = 0, 1, 2

LONGEST_ERROR = 1000
"""Bytes of UTF-8 of a chunk's error that are kept."""


SHOWN = 200
"""Characters of the error of a damaged store that are shown."""


def check_begun(path: Path) -> None:
    """Raise `InputError` if there is no store at a path: nothing, or something else."""
    if (path / "zarr.json").exists():
        return
    if not path.exists():
        raise InputError(f"{path}: no such store: there is no zarr.json.")
    what = "a folder without zarr.json" if path.is_dir() else "a file"
    raise InputError(f"{path}: is {what}, and no sweep's store; take another name, or remove it.")


class Store:
    """A sweep's store at `path`, opened for reading and writing chunks."""

    def __init__(self, path: str | os.PathLike):
        zarr = kit.require("zarr", "storing a sweep", "sweep")
        self.path = path_of(path)
        check_begun(self.path)
        with self._told_if_damaged("zarr.json"):
            self.group = zarr.open_group(self.path, mode="r+")
            told = self.group.attrs.get(MANIFEST)
            if told is not None:
                self._read_identity(json.loads(told), json.loads(self.group.attrs[ABOUT]))
        if told is None:
            raise InputError(f"{self.path}: a Zarr store, but no sweep's: it does not have the attribute {MANIFEST}.")

    def _read_identity(self, identity: dict[str, Any], about: dict[str, Any]) -> None:
        self.identity, self.about = identity, about
        axes = self.identity["design"]
        self.labels = {axis["name"]: tuple(axis["labels"]) for axis in axes}
        self.columns = {axis["name"]: axis.get("columns") for axis in axes}
        self.is_choice = {axis["name"]: bool(axis["choice"]) for axis in axes}
        numbers = [len(axis["labels"]) for axis in axes if not axis["choice"]]
        choices = [len(axis["labels"]) for axis in axes if axis["choice"]]
        shape = (*numbers, self.identity["seeds"])
        self.plan = Plan(int(np.prod(choices, dtype=int)), shape, tuple(self.identity["batch"]))
        self._choices = tuple(choices)
        self._chosen = tuple(i for i, is_choice in enumerate(self.is_choice.values()) if is_choice)

    @contextlib.contextmanager
    def _told_if_damaged(self, what: str) -> Iterator[None]:
        """Name the store and the part of it that cannot be read: files are cut by full disks and by copies that were stopped."""
        try:
            yield
        except (AttributeError, KeyError, RuntimeError, TypeError, ValueError) as error:
            words = " ".join(str(error).split())[:SHOWN]
            raise InputError(
                f"{self.path}: {what} is damaged ({words}). Restore the store, or remove it: the same sweep computes it again."
            ) from error

    def design(self) -> Design:
        """The design, with labels instead of the objects to choose from."""
        design = Design()
        arrays = lambda columns: None if columns is None else {name: np.asarray(one) for name, one in columns.items()}
        design.axes = tuple(
            Axis(name, labels, labels, self.is_choice[name], arrays(self.columns[name]))
            for name, labels in self.labels.items()
        )
        return design

    @property
    def names(self) -> tuple[str, ...]:
        """The values' names."""
        return tuple(self.identity["values"])

    def check_units(self, units: Mapping[str, str]) -> None:
        """Raise `InputError` for units other than those with which the store was begun; otherwise they would be ignored."""
        if units != self.about["units"]:
            raise InputError(
                f"{self.path}: it was begun with units = {self.about['units']}, here they are {units}. Take another store, or "
                "the units with which it was begun."
            )

    def read(self, name: str) -> np.ndarray:
        """All of one value: (axes..., seeds, ...)."""
        with self._told_if_damaged(name):
            return np.asarray(self.group[name][...])

    def status(self) -> np.ndarray:
        """The status of each chunk: 0 not done, 1 done, 2 failed."""
        with self._told_if_damaged(STATUS):
            return np.asarray(self.group[STATUS][:])

    def is_done(self, number: int) -> bool:
        """Whether a chunk is done, by any process."""
        return int(self.group[STATUS][number]) == DONE

    def error(self, number: int) -> str:
        """The error with which a chunk failed."""
        return bytes(self.group[ERROR][number]).rstrip(b"\0").decode(errors="replace")

    def write(self, chunk: Chunk, values: Mapping[str, np.ndarray]) -> None:
        """Write a chunk's values (*size, ...) by name, then its mark."""
        where = self._region(chunk)
        for name, array in values.items():
            self.group[name][where] = np.expand_dims(array, self._chosen)
        self.group[STATUS][chunk.number : chunk.number + 1] = np.asarray([DONE], np.int8)

    def write_failure(self, number: int, error: str) -> None:
        """Mark a chunk as failed, with its error."""
        # The cause is at the end of a traceback.
        text = np.frombuffer(error.encode()[-LONGEST_ERROR:].ljust(LONGEST_ERROR, b"\0"), np.uint8)
        self.group[ERROR][number] = text
        self.group[STATUS][number : number + 1] = np.asarray([FAILED], np.int8)

    def _region(self, chunk: Chunk) -> tuple[slice, ...]:
        """The slices of a chunk's values along the design's axes and the seeds."""
        choice = iter(np.unravel_index(chunk.choice, self._choices) if self._choices else ())
        block = iter(zip(chunk.start, chunk.size, strict=True))
        along = []
        for is_choice in self.is_choice.values():
            start, size = (int(next(choice)), 1) if is_choice else next(block)
            along.append(slice(start, start + size))
        start, size = next(block)
        return (*along, slice(start, start + size))


def create(
    path: Path,
    identity: Mapping[str, Any],
    design: Design,
    plan: Plan,
    values: Mapping[str, Any],
    about: Mapping[str, Any],
) -> Store:
    """Make a store for values of these shapes and dtypes (of one run) by name; it is there only once it is complete.
    `about`: `units` by name and a `note`."""
    zarr = kit.require("zarr", "storing a sweep", "sweep")
    if path.exists():
        raise InputError(f"{path}: exists and is no sweep's store; take another name.")
    taken = {SEED, STATUS, ERROR, *(axis.name for axis in design.axes)} & {*values}
    if taken:
        raise InputError(
            f"run: {', '.join(sorted(taken))} of its result has the name of an axis or of a store's own array."
        )
    part = path.with_name(f"{path.name}.part")
    group = zarr.open_group(part, mode="w", zarr_format=3)
    _write_axes(group, design)
    _make_values(group, design, plan, values)
    group.create_array(
        STATUS, shape=(plan.chunks,), chunks=(1,), dtype="int8", fill_value=NOT_DONE, dimension_names=("chunk",)
    )
    group.create_array(
        ERROR, shape=(plan.chunks, LONGEST_ERROR), chunks=(1, LONGEST_ERROR), dtype="uint8", fill_value=0,
        dimension_names=("chunk", "letter"),
    )  # fmt: skip
    for name, unit in about["units"].items():
        if name not in group:
            raise InputError(f"units: {name} is neither a value nor an axis; there are: {', '.join(sorted(group))}.")
        group[name].attrs["units"] = unit
    group.attrs[ABOUT] = json.dumps(about)
    # As text, so that it is read back unchanged for later comparisons.
    group.attrs[MANIFEST] = json.dumps({**identity, "values": list(values)})
    with warnings.catch_warnings():
        # xarray opens the store faster with it, and warns without it; other readers ignore it.
        warnings.filterwarnings("ignore", "Consolidated metadata", UserWarning)
        zarr.consolidate_metadata(part)
    part.rename(path)
    return Store(path)


def _write_axes(group: Any, design: Design) -> None:
    """The labels of choices, the numbers of axes, and the columns of samples."""
    for axis in design.axes:
        if axis.choice:
            labels = group.create_array(axis.name, shape=(len(axis.labels),), dtype="str", dimension_names=(axis.name,))
            labels[:] = np.asarray([str(label) for label in axis.labels])
        else:
            dtype = float if axis.columns is None else np.int64
            group.create_array(axis.name, data=np.asarray(axis.labels, dtype), dimension_names=(axis.name,))
            for name, column in (axis.columns or {}).items():
                group.create_array(f"{axis.name}.{name}", data=column, dimension_names=(axis.name,))


def _make_values(group: Any, design: Design, plan: Plan, values: Mapping[str, Any]) -> None:
    """An array for each value, with a place for every run and chunks as the plan has them."""
    names = [axis.name for axis in design.axes]
    for name, one in values.items():
        group.create_array(
            name,
            shape=(*(len(axis.values) for axis in design.axes), plan.shape[-1], *one.shape),
            chunks=(*_block(design, plan), *(max(1, n) for n in one.shape)),
            dtype=one.dtype,
            fill_value=fill_value_of(one.dtype),
            dimension_names=(*names, SEED, *(f"{name}{OWN}{i}" for i in range(len(one.shape)))),
        )


def fill_value_of(dtype: Any) -> Any:
    """The value of places that are not computed: NaN, the least integer, or False."""
    dtype = np.dtype(dtype)
    if dtype.kind in "fc":
        return dtype.type(np.nan)
    return np.iinfo(dtype).min if dtype.kind == "i" else dtype.type(0)


def _block(design: Design, plan: Plan) -> Iterator[int]:
    block = iter(plan.block)
    for axis in design.axes:
        yield 1 if axis.choice else next(block)
    yield next(block)
