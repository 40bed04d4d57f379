"""The stores of a study with several sweeps: one store per sweep, in one folder."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_whole, path_of
from jaxveh._core.progress import Progress, silent
from jaxveh.sweeps.design import Design
from jaxveh.sweeps.running import sweep
from jaxveh.sweeps.store import DONE, Store
from jaxveh.sweeps.swept import Swept, arrays_of, named_leaves

RUNS = 100
"""Default number of runs of a chunk. A run is a whole drive, or a filter over a drive that keeps rows: up to four
megabytes, so that a chunk fits every machine. Round numbers of seeds are cut without a remainder."""


@dataclasses.dataclass(frozen=True)
class Stores:
    """Where the sweeps of a study go: NAME.zarr in the `folder`; without a folder they stay in memory.

    They are computed in this process, in this number of `processes`, or by a Dask `client` (or a scheduler's address).

    **Raises** `InputError` for processes or a client without a folder, and for both together.
    """

    folder: str | os.PathLike | None = None
    processes: int | None = None
    client: Any = None

    def __post_init__(self):
        if self.folder is not None:
            path_of(self.folder)
        if self.folder is None and (self.processes, self.client) != (None, None):
            raise InputError(
                "stores: processes= and client= need a folder=; without a folder the sweeps run in this process."
            )
        if self.processes is not None and self.client is not None:
            raise InputError("stores: give client= or processes=, not both.")
        if self.processes is not None:
            check_whole("processes", self.processes)

    def under(self, name: str) -> Stores:
        """The stores of a part of the study: those in the subfolder of this name."""
        return self if self.folder is None else dataclasses.replace(self, folder=Path(self.folder) / name)

    def sweep(
        self,
        name: str,
        run: Callable[..., Any],
        design: Design,
        seeds: int | None = None,
        key: Any = None,
        *,
        data: Any = None,
        batch: int | None = None,
        alike: int | None = None,
        devices: list | None = None,
        score: Callable[[dict[str, Any], Any], Any] | None = None,
        progress: Progress = silent,
    ) -> Swept:
        """`sweeps.sweep`, in the store of this `name` if there are stores: finished chunks are read and not computed.

        Arguments are those of `sweeps.sweep`; `devices` are for a sweep without a store. Chunks of a store have `batch` or
        `RUNS` runs. `alike`: the number of runs at a time without a store. Sweeps of one function with as many are one program,
        which is compiled once where programs are kept (as those of `jaxveh reproduce` are). `score(values, data)` makes the
        values that are found from those of a run, by dotted name, and the run's data. Without a store it is a program of its
        own, which sweeps of many runs with the same kinds of values share. The result is in memory: the tables of a study read
        each value many times.

        **Raises** `InputError` as `sweeps.sweep` does, for a `score` without data or with choices, and if chunks have failed: the
        study needs all of them.
        """
        if score is not None and (design.choices or data is None):
            raise InputError("score: needs data, and a design of numbers alone: values of choices differ in shape.")
        if self.folder is None:
            at_once = batch if alike is None else alike
            found = sweep(run, design, seeds, key, data=data, batch=at_once, devices=devices, progress=progress)
            return found if score is None else _scored(found, score, data, at_once, devices)
        if score is not None:
            run = _with_score(run, score)
        path = Path(self.folder) / f"{name}.zarr"
        found = sweep(
            run, design, seeds, key, data=data, batch=RUNS if batch is None else batch, progress=progress,
            store=path, processes=self.processes, client=self.client,
        )  # fmt: skip
        missing = int(np.sum(Store(path).status() != DONE))
        if missing:
            raise InputError(
                f"{path}: the study needs the {missing} chunks that are not done. Start again to compute them."
            )
        # The choices themselves, as a store has only their labels.
        return Swept(design, found.seeds, dict(found.values))

    def each(self, name: str, function: Callable[..., Any], *arguments: Any, progress: Progress = silent) -> Any:
        """`jax.vmap(function)(*arguments)` for trees of arrays with the same first axis, as a sweep of this `name` over its
        rows.

        **Raises** `InputError` as `sweep` does.
        """
        if self.folder is None:
            return jax.jit(jax.vmap(function))(*arguments)
        kinds, kinds_found = _kinds(arguments), []

        def run(point: Any, given: Any) -> dict[str, Any]:
            del point
            return {"found": _words(function(*_keyed(given, kinds)))}

        found = self.sweep(name, run, Design(), data=_words(arguments), progress=progress)

        def noted(*given: Any) -> Any:
            result = function(*given)
            # A shape does not contain the kind of a key.
            kinds_found[:] = _kinds(result)
            return result

        shapes = jax.eval_shape(jax.vmap(noted), *arguments)
        names, structure = named_leaves({"found": shapes}), jax.tree.structure(shapes)
        values = [jax.numpy.asarray(found.values[one]) for one in names]
        return _keyed(jax.tree.unflatten(structure, values), kinds_found)


def _scored(found: Swept, score: Callable[..., Any], data: Any, batch: int | None, devices: list | None) -> Swept:
    """The scores of a sweep's values, as a sweep of their own."""
    one = lambda point, given: score(*given)
    return sweep(one, found.design, data=(dict(found.values), data), batch=batch, devices=devices)


def _with_score(run: Callable[..., Any], score: Callable[..., Any]) -> Callable[..., Any]:
    """The run whose values are scored with its data, its last argument."""
    return lambda *given: score(arrays_of(run(*given)), given[-1])


def _kinds(tree: Any) -> list[str]:
    """The kind of key of each leaf; empty if it is no key."""
    is_key = lambda leaf: jax.numpy.issubdtype(jax.numpy.asarray(leaf).dtype, jax.dtypes.prng_key)
    return [str(jax.random.key_impl(leaf)) if is_key(leaf) else "" for leaf in jax.tree.leaves(tree)]


def _words(tree: Any) -> Any:
    """The tree with keys replaced by their words: neither data nor a store can have keys."""
    leaves, structure = jax.tree.flatten(tree)
    leaves = [jax.numpy.asarray(leaf) for leaf in leaves]
    keys = zip(leaves, _kinds(leaves), strict=True)
    return jax.tree.unflatten(structure, [jax.random.key_data(leaf) if kind else leaf for leaf, kind in keys])


def _keyed(tree: Any, kinds: list[str]) -> Any:
    """The tree that was given to `_words`, with keys of these kinds."""
    leaves, structure = jax.tree.flatten(tree)
    words = zip(leaves, kinds, strict=True)
    return jax.tree.unflatten(
        structure, [jax.random.wrap_key_data(leaf, impl=kind) if kind else leaf for leaf, kind in words]
    )


IN_MEMORY = Stores()
"""The default: nothing is stored."""
