"""One chunk of a stored sweep: computed and written by any process."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxveh.io import kit
from jaxveh.sweeps import identity
from jaxveh.sweeps.design import Design
from jaxveh.sweeps.store import Store
from jaxveh.sweeps.swept import arrays_of, named_leaves
from jaxveh.sweeps.workers import fit_for


class Unfit(Exception):
    """A process that would compute other numbers than the process that began the sweep."""


def lower(run: Callable[..., Any], design: Design, choices: dict[str, Any], arguments: tuple) -> Any:
    """The program of a chunk with these choices, lowered for its arguments."""
    one = lambda numbers, *rest: arrays_of(run(design.point(numbers, choices), *rest))
    return jax.jit(jax.vmap(one)).lower(*arguments)


class ChunkError(Exception):
    """An error in a chunk, as text: not every error can be sent from one process to another."""


class Job(NamedTuple):
    """Everything that a process needs for any chunk, except the runs' arguments."""

    run: Callable[..., Any]
    design: Design
    path: str

    def to_bytes(self) -> bytes:
        """The job as bytes. Functions of a script, a notebook or a user's own module go by value, as workers may not have
        it."""
        cloudpickle = kit.require("cloudpickle", "sending a sweep to other processes", "sweep")
        module = inspect.getmodule(self.run)
        if module is None or not _is_ones_own(module):
            return cloudpickle.dumps(self)
        cloudpickle.register_pickle_by_value(module)
        try:
            return cloudpickle.dumps(self)
        finally:
            cloudpickle.unregister_pickle_by_value(module)


def _is_ones_own(module: ModuleType) -> bool:
    """Whether a module is a file that is not installed as a package."""
    file, name = getattr(module, "__file__", None), module.__name__
    return file is not None and name != "__main__" and name.partition(".")[0] != "jaxveh" and "-packages" not in file


class Computing:
    """What one process keeps from chunk to chunk: the open store, and a compiled program for each combination of choices."""

    def __init__(self, job: Job, lowered: dict[int, Any] | None = None):
        self.job, self.store = job, Store(job.path)
        self._choices = [(said, objects) for _, said, objects in job.design.combinations()]
        self._lowered = {} if lowered is None else lowered
        self._compiled: dict[int, Any] = {}
        here, stored = identity.of_process(), self.store.identity
        differs = [name for name in identity.OF_PROCESS if here[name] != stored[name]]
        if differs:
            name = differs[0]
            raise Unfit(f"{name} is {here[name]!r} here, but {stored[name]!r} in the process that began the sweep")

    def do(self, number: int, arguments: tuple) -> None:
        """Compute a chunk and write it, unless it is already done."""
        if self.store.is_done(number):
            return
        chunk = self.store.plan.chunk(number)
        found = self._program(chunk.choice, arguments)(*arguments)
        values = {name: np.asarray(leaf) for name, leaf in named_leaves(found).items()}
        self.store.write(chunk, {name: self.store.plan.inside(chunk, array) for name, array in values.items()})

    def _program(self, choice: int, arguments: tuple) -> Any:
        if choice not in self._compiled:
            said, objects = self._choices[choice]
            lowered = self._lowered.pop(choice, None)
            if lowered is None:
                lowered = lower(self.job.run, self.job.design, objects, arguments)
            wanted = self.store.identity["programs"][said]
            if identity.of_program(lowered) != wanted:
                raise Unfit(
                    f"run computes something else here ({said or 'its program'}) than in the process that began the sweep"
                )
            program = lowered.compile()
            fit_for(program, jax.devices()[:1])  # warns if it may never end
            self._compiled[choice] = program
        return self._compiled[choice]


_jobs: dict[str, Computing] = {}
"""The job that this process works on, by its hash; only the last one."""


def do_chunk(packed: bytes, number: int, arguments: tuple, settings: dict[str, Any]) -> int:
    """Compute one chunk in a worker process, with `arguments` as `packed_arguments` makes them. Returns its number."""
    which = hashlib.sha256(packed).hexdigest()
    if which not in _jobs:
        for name, value in settings.items():
            jax.config.update(name, value)
        _jobs.clear()
        try:
            job = kit.require("cloudpickle", "a sweep's worker", "sweep").loads(packed)
        except Exception as error:
            raise Unfit(f"it cannot read the job ({type(error).__name__}: {error})") from None
        _jobs[which] = Computing(job)
    try:
        _jobs[which].do(number, unpacked_arguments(arguments))
    except OSError:
        raise
    except Exception as error:
        raise error if isinstance(error, Unfit) else ChunkError(f"{type(error).__name__}: {error}") from None
    return number


def settings_of_jax() -> dict[str, Any]:
    """Settings of this process that others need to compute the same numbers, and the folder of compiled programs."""
    names = (*identity.CONFIGURED, "jax_numpy_dtype_promotion", "jax_compilation_cache_dir")
    return {name: getattr(jax.config, name) for name in names}


class _Key(NamedTuple):
    words: np.ndarray
    impl: str


def packed_arguments(arguments: tuple) -> tuple:
    """Arguments of runs as NumPy arrays, which any process can read."""
    return jax.tree.map(_pack, arguments)


def _pack(leaf: Any) -> Any:
    if jax.numpy.issubdtype(leaf.dtype, jax.dtypes.prng_key):
        return _Key(np.asarray(jax.random.key_data(leaf)), str(jax.random.key_impl(leaf)))
    return np.asarray(leaf)


def unpacked_arguments(arguments: tuple) -> tuple:
    """The arguments that were given to `packed_arguments`."""
    is_key = lambda leaf: isinstance(leaf, _Key)
    unpack = lambda leaf: (
        jax.random.wrap_key_data(leaf.words, impl=leaf.impl) if is_key(leaf) else jax.numpy.asarray(leaf)
    )
    return jax.tree.map(unpack, arguments, is_leaf=is_key)
