"""A sweep into a store: finished chunks are kept if a process is killed, and a second call continues.

Only one chunk is kept in memory; the store has one Zarr array for each value, which xarray opens. The result is the same to
the last bit, however often the sweep was interrupted and whichever process computed a chunk. A store refuses another
design, key, data, program, version, flag or processor, and names it; it also refuses a second sweep at the same time.
Everything that a chunk needs is sent with it; workers write to the store themselves and must see it under the same path.
The chunk of a dead worker is computed again, and so is one that takes longer than `patience`; one that fails three times is
recorded with its error, and tried again by the next call.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_whole, path_of, warn
from jaxveh._core.progress import Progress
from jaxveh.io import kit
from jaxveh.sweeps import identity
from jaxveh.sweeps.chunks import Computing, Job, lower, packed_arguments
from jaxveh.sweeps.crews import crew_for
from jaxveh.sweeps.design import Design
from jaxveh.sweeps.driving import TRIES, drive
from jaxveh.sweeps.given import Given
from jaxveh.sweeps.lateness import warn_when_late
from jaxveh.sweeps.plan import plan_for
from jaxveh.sweeps.store import DONE, FAILED, Store, create
from jaxveh.sweeps.swept import Swept

BATCH = 1000
"""Default number of runs of a chunk. It does not depend on this machine's memory, as the numbers must not depend on it."""

SCRAPPED_AFTER = 3600.0
"""s: age from which on partly written files are removed."""

PROBED = 1.0
"""s: how long to wait for a lock, which another sweep may hold for a moment to test it."""


def sweep_into(
    path: str | os.PathLike,
    run: Callable[..., Any],
    design: Design,
    given: Given,
    *,
    batch: int | None,
    client: Any,
    processes: int | None,
    part: tuple[int, int] | None,
    patience: float | None,
    progress: Progress,
    units: Mapping[str, str],
    note: str,
) -> Swept:
    """`sweep` with a store; the arguments are those of `sweep`."""
    check_whole("batch", BATCH if batch is None else batch)
    if client is not None and processes is not None:
        raise InputError("sweep: give client= or processes=, not both.")
    path = path_of(path)
    if path.exists():
        Store(path)  # what is no sweep's is refused before locks are made beside it
    with only_one(path, part) as is_mine:
        job = Job(run, design, str(path.resolve()))
        with _beginning(path):
            lowered, store = _begin(path, run, design, given, batch, {"units": dict(units), "note": note})
        status = store.status()
        mine = [int(i) for i in np.flatnonzero(status != DONE) if is_mine(int(i))]
        total = sum(is_mine(i) for i in range(store.plan.chunks))
        done = total - len(mine)
        arguments = lambda number: given.of_runs(store.plan.runs(store.plan.chunk(number)))

        def told(number: int) -> None:
            nonlocal done
            done += 1
            progress(done, total, f"chunks of {store.plan.batch} runs")

        progress(done, total, f"chunks of {store.plan.batch} runs")
        if client is None and processes is None:
            _alone(Computing(job, lowered), mine, arguments, patience, told)
        elif mine:
            packed = job.to_bytes()
            with crew_for(client, processes, packed, lambda number: packed_arguments(arguments(number))) as crew:
                limit = float("inf") if patience is None else patience
                drive(crew, mine, limit, told, store.write_failure)
    _warn_of_missing(store, is_mine)
    return _found(store)


def _alone(computing: Computing, numbers: list[int], arguments, patience: float | None, told) -> None:
    """All chunks in this process; an error that a chunk raises three times is recorded, an error of the disk ends the
    sweep."""
    for number in numbers:
        given = arguments(number)
        with warn_when_late(f"chunk {number}", patience):
            for attempt in range(1, TRIES + 1):
                try:
                    computing.do(number, given)
                except (OSError, InputError):
                    raise
                except Exception as error:
                    if attempt == TRIES:
                        computing.store.write_failure(number, f"{type(error).__name__}: {error}")
                else:
                    break
        told(number)


def _begin(
    path: Path, run, design: Design, given: Given, batch: int | None, about: dict[str, Any]
) -> tuple[dict[int, Any], Store]:
    """The store, new or found with the same identity; and the lowered programs by the combination's number."""
    if path.exists():
        store = Store(path)
        _remove_scraps(path)
        plan = store.plan
        if batch is not None:
            plan = plan_for(plan.choices, given.shape, min(batch, given.runs))
    else:
        choices = int(np.prod([len(axis.values) for axis in design.choices], dtype=int))
        store, plan = None, plan_for(choices, given.shape, min(BATCH if batch is None else batch, given.runs))
    lowered, programs, values = {}, {}, None
    for i, (_, said, objects) in enumerate(design.combinations()):
        # Any runs, as many as in a chunk: only their shapes matter.
        lowered[i] = lower(run, design, objects, given.chunk(0, plan.batch))
        programs[said] = identity.of_program(lowered[i])
        shapes = {name: (leaf.shape[1:], leaf.dtype) for name, leaf in lowered[i].out_info.items()}
        if values is not None and shapes != values:
            raise InputError(f"run returns other names, shapes or dtypes with {said} than with the first choice.")
        values = shapes
    asked = identity.identity(design, given, plan, programs)
    if store is not None:
        identity.check_same(path, store.identity, asked)
        store.check_units(about["units"])
        return lowered, store
    shaped = {name: jax.ShapeDtypeStruct(*one) for name, one in (values or {}).items()}
    shutil.rmtree(path.with_name(f"{path.name}.part"), ignore_errors=True)
    return lowered, create(path, asked, design, plan, shaped, about)


def _remove_scraps(path: Path) -> None:
    """Remove files that a killed process left partly written, once they are too old to be in use."""
    for scrap in path.rglob("*.partial"):
        with contextlib.suppress(OSError):
            if time.time() - scrap.stat().st_mtime > SCRAPPED_AFTER:
                scrap.unlink()


@contextlib.contextmanager
def _beginning(path: Path) -> Iterator[None]:
    """Let parts that start at the same time begin the store one after the other."""
    filelock = kit.require("filelock", "storing a sweep", "sweep")
    with filelock.FileLock(path.with_name(f".{path.name}.begin"), timeout=600):
        yield


def _check_writable(path: Path) -> None:
    """Make the folder of the store; raise `InputError` if nothing can be written there: a lock would seem to be held for ever."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise InputError(f"{path}: nothing can be written in {path.parent} ({why}); take another folder.") from error


@contextlib.contextmanager
def only_one(path: Path, part: tuple[int, int] | None) -> Iterator[Callable[[int], bool]]:
    """Lock the store, or one of its parts, against other sweeps while the block runs; gives a test for one's own chunks.

    The locks are files beside the store. The system releases them when their process ends, however it ends.
    """
    filelock = kit.require("filelock", "storing a sweep", "sweep")
    if part is not None and not (len(part) == 2 and 0 <= part[0] < part[1]):
        raise InputError(f"part = {part!r}: must be (i, n) with 0 <= i < n.")
    _check_writable(path)
    name = "lock" if part is None else f"part-{part[0]}-of-{part[1]}.lock"
    lock = filelock.FileLock(path.with_name(f".{path.name}.{name}"), timeout=PROBED)
    try:
        lock.acquire()
    except filelock.Timeout:
        raise InputError(f"{path}: another sweep is writing it; wait, or give each its own part=(i, n).") from None
    try:
        with _others(path, part, filelock):
            yield (lambda number: True) if part is None else (lambda number: number % part[1] == part[0])
    finally:
        lock.release()


@contextlib.contextmanager
def _others(path: Path, part: tuple[int, int] | None, filelock: Any) -> Iterator[None]:
    """Refuse sweeps that would share chunks: a whole sweep beside a part, or parts of another number."""
    own = "" if part is None else f"-of-{part[1]}.lock"
    for other in path.parent.glob(f".{path.name}.*lock"):
        if other.name.endswith(own) and part is not None and ".part-" in other.name:
            continue
        if part is None and other.name == f".{path.name}.lock":
            continue
        probe = filelock.FileLock(other, timeout=0)
        try:
            probe.acquire()
        except filelock.Timeout:
            raise InputError(
                f"{path}: another sweep ({other.name}) is writing some of the same chunks; wait for it."
            ) from None
        probe.release()
    yield


class Values(Mapping):
    """A store's values by name, read on access."""

    def __init__(self, store: Store):
        self._store = store

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._store.names:
            raise KeyError(name)
        return self._store.read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._store.names)

    def __len__(self) -> int:
        return len(self._store.names)


def read_sweep(path: str | os.PathLike) -> Swept:
    """The content of a sweep's store, read value by value on access, with the labels of choices instead of the objects.

    **Warns** (`JaxvehWarning`) about chunks that are not done, whose values are NaN (the least integer, False), and about
    those that failed, with the first error.
    """
    store = Store(path)
    _warn_of_missing(store, lambda number: True)
    return _found(store)


def _found(store: Store) -> Swept:
    return Swept(store.design(), store.plan.shape[-1], Values(store), **store.about)


def _warn_of_missing(store: Store, is_asked: Callable[[int], bool]) -> None:
    """Warn about chunks of this call that are not done."""
    status = store.status()
    missing = [int(i) for i in np.flatnonzero(status != DONE) if is_asked(int(i))]
    if not missing:
        return
    failed = [i for i in missing if status[i] == FAILED]
    why = f"; {len(failed)} of them failed: {_last_line(store.error(failed[0]))}" if failed else ""
    warn(
        f"{store.path}: {len(missing)} of {store.plan.chunks} chunks are not done{why}. The same sweep again goes on with them."
    )


def _last_line(error: str) -> str:
    """The last line of an error, which contains the cause if there are several lines."""
    lines = [line.strip() for line in error.splitlines() if line.strip()]
    return lines[-1] if lines else "no reason was given"
