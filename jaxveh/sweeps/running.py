"""The runs of a sweep: one compiled program for each choice, fed with chunks that fit into memory, split over the devices."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh
from jax.sharding import PartitionSpec as P

from jaxveh._core.errors import InputError, check_callable, check_kind, check_positive, check_takes, check_whole
from jaxveh._core.names import as_pairs, as_several
from jaxveh._core.progress import Progress, check_progress, silent
from jaxveh.sweeps.design import Design
from jaxveh.sweeps.given import Given
from jaxveh.sweeps.lateness import warn_when_late
from jaxveh.sweeps.stored import sweep_into
from jaxveh.sweeps.swept import Swept, arrays_of, named_leaves
from jaxveh.sweeps.workers import fit_for

SHARE_OF_MEMORY = 0.5
"""Share of the machine's memory that a chunk may take, unless `memory` is given."""

PATIENCE = 900.0
"""Time that a chunk may take before a warning, s, unless `patience` is given."""


def sweep(
    run: Callable[..., Any],
    design: Design,
    seeds: int | None = None,
    key: Any = None,
    *,
    data: Any = None,
    batch: int | None = None,
    memory: float | None = None,
    devices: list | None = None,
    patience: float | None = PATIENCE,
    progress: Progress = silent,
    store: str | os.PathLike | None = None,
    client: Any = None,
    processes: int | None = None,
    part: tuple[int, int] | None = None,
    units: Mapping[str, str] | None = None,
    note: str = "",
) -> Swept:
    """Call `run` at every point of the design, always with the same seeds, so that points can be compared in pairs.

        sweep(lambda point, key: ..., design, seeds, key)             each seed is a key, split from `key`
        sweep(lambda point, drive: ..., design, data=drives)          each seed is a part of `data`: nothing is drawn
        sweep(lambda point, key, drive: ..., design, seeds, key, data=drives)

    **Arguments**: `run`, a pure function of one point (a NamedTuple with the design's names) and of a key, of data or of
    both, as given, that returns a mapping or NamedTuple of arrays (trees of them get dotted names, `parameters.front.B`);
    `seeds`, how many (default: as many as in `data`); `data`, a tree of arrays that begin with the axes of numbers and the seeds:
    each run gets its own part (drives for several filters); `batch`, runs at a time (default: all points of a choice, or as
    many as fit into `memory`, bytes: half of the machine's); `devices`, over which a batch is split by `shard_map` (default:
    all of `jax.devices()`: on a CPU one, unless `jax_num_cpu_devices` is set before jax starts; a run that fits with
    optimistix takes one, `jax.devices()[:1]`: linear solves of lineax do not work under `shard_map`); `patience`, s: each
    time that a chunk, or compiling, has taken this long, a `JaxvehWarning` names it and gives the remedy (None: never);
    `progress(done, total, stage)` is called between chunks.

    With `store`, a folder such as "sweep.zarr", each chunk of `batch` runs (1000) is written when it is done, and the same
    call continues there (see `sweeps/stored.py`): in this process, in `processes=N`, with a Dask `client=` (or a scheduler's
    address), or one share `part=(i, n)` of an array of jobs; each with one device. `sweeps.read_sweep(store)` opens it
    again. `units` of values and axes by name, and a `note`, are shown and stored beside the numbers.

    Every choice is compiled once, whatever the number of chunks; and again for fewer devices if the devices could wait for
    each other for ever (large batches of LAPACK routines with jax before 0.12; see `sweeps/workers.py`).

    **Raises** `InputError` for bad counts, neither a key nor data, data of another shape, a `run` that returns nothing named,
    and a store that was begun with something else or that another sweep is writing. **Warns** if a program may never end.
    """
    units = dict(as_pairs({} if units is None else units, "units"))
    _check_kinds(run, design, patience, progress, units, note)
    given = _given(run, design, seeds, key, data)
    if store is not None or (client, processes, part) != (None, None, None):
        if store is None or (memory, devices) != (None, None):
            raise InputError(
                "sweep: client=, processes= and part= need a store=; memory= and devices= are for sweeps without one."
            )
        asked = {"batch": batch, "client": client, "processes": processes, "part": part, "patience": patience}
        asked |= {"units": units, "note": note}
        return sweep_into(store, run, design, given, progress=progress, **asked)
    devices = _devices(devices)
    found = _in_memory(run, design, given, batch, memory, devices, patience, progress)
    return dataclasses.replace(found, units=units, note=note)


def _given(run: Callable, design: Design, seeds: int | None, key: Any, data: Any) -> Given:
    given = Given(design, seeds, key, data)
    check_takes("run", run, "point", *given.names)
    return given


def _check_kinds(run, design, patience, progress, units: dict[str, Any], note) -> None:
    check_callable("run", run, "Such as lambda point, key: ...")
    check_kind("design", design, Design, "Such as sweeps.Design(noise=[0.01, 0.02]).")
    if patience is not None:
        check_positive("patience", patience, "s")
    check_progress(progress)
    for name, unit in units.items():
        check_kind(f"units of {name}", unit, str)
    check_kind("note", note, str)


def _devices(given: list | None) -> list:
    """The given devices, or all."""
    found = jax.devices() if given is None else list(as_several(given, "devices"))
    for device in found:
        check_kind("devices", device, jax.Device, "Such as jax.devices()[:1].")
    return found


def _in_memory(run, design: Design, given: Given, batch, memory, devices, patience, progress) -> Swept:
    """All choices one after the other, each with all its runs."""
    done, total = 0, given.runs * int(np.prod([len(axis.values) for axis in design.choices]))
    found = []
    for _, said, choices in design.combinations():
        one = lambda numbers, *rest, choices=choices: run(design.point(numbers, choices), *rest)
        report = lambda n, said=said, done=done: progress(done + n, total, said or "runs")
        late = lambda what, said=said: warn_when_late(f"{what} ({said})" if said else what, patience)
        found.append(_all(one, given, batch, memory, devices, report, late))
        done += given.runs
    return Swept(design, given.seeds, _arrange(design, given.seeds, found))


def _all(one, given: Given, batch, memory, devices, report, late) -> dict[str, np.ndarray]:
    """All runs of one choice: values by name, (R, ...)."""
    batch = given.runs if batch is None else batch
    check_whole("batch", batch)
    with late("compiling"):
        program, batch = _program(one, given, min(batch, given.runs), memory, devices)
    parts = []
    for first in range(0, given.runs, batch):
        report(first)
        with late(f"the chunk of runs {first + 1} to {min(first + batch, given.runs)} of {given.runs}"):
            part = program(*given.chunk(first, batch))
            parts.append({n: np.asarray(leaf)[: given.runs - first] for n, leaf in named_leaves(part).items()})
    report(given.runs)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _program(one, given: Given, batch, memory, devices):
    """The compiled program of a chunk, and its number of runs: fewer than `batch` if they would not fit into memory."""
    memory = SHARE_OF_MEMORY * _machine_memory() if memory is None else memory
    check_positive("memory", memory, "bytes")
    while True:
        width = len(devices)
        batch = -(-batch // width) * width
        program = _split_over(one, devices).lower(*given.chunk(0, batch)).compile()
        fit = fit_for(program, devices)
        if len(fit) < width:
            devices = fit
            continue
        needed = _bytes_needed(program)
        if needed <= memory or batch == width:
            return program, batch
        batch = max(width, int(batch * memory / needed))


def _split_over(one, devices):
    many = jax.vmap(lambda *one_run: arrays_of(one(*one_run)))
    if len(devices) == 1:
        return jax.jit(many)
    mesh, along = Mesh(np.asarray(devices), ("runs",)), P("runs")
    return jax.jit(jax.shard_map(many, mesh=mesh, in_specs=along, out_specs=along, check_vma=False))


def _bytes_needed(program) -> float:
    """Bytes that a compiled program takes while it runs; 0 if the backend does not report them."""
    analysis = program.memory_analysis()
    if analysis is None:
        return 0.0
    return float(analysis.temp_size_in_bytes + analysis.output_size_in_bytes + analysis.argument_size_in_bytes)


def _machine_memory() -> float:
    """Bytes; infinite if the system does not report them (Windows)."""
    if not hasattr(os, "sysconf"):
        return float("inf")
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _arrange(design: Design, seeds: int, found: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Values by name with the design's axes in their order, then the seeds."""
    chosen = tuple(len(axis.values) for axis in design.choices)
    counted = tuple(len(axis.values) for axis in design.numbers)
    order = [*design.choices, *design.numbers]
    place = [order.index(axis) for axis in design.axes]
    values = {}
    for name in found[0]:
        stacked = np.stack([part[name] for part in found])
        rest = stacked.shape[2:]
        whole = stacked.reshape(*chosen, *counted, seeds, *rest)
        values[name] = np.transpose(whole, (*place, *range(len(order), whole.ndim)))
    return values
