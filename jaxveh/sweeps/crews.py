"""Workers that compute chunks outside this process: processes of this machine (loky), or workers of a Dask scheduler
(distributed)."""

from __future__ import annotations

import contextlib
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

from jaxveh._core.errors import InputError, check_whole
from jaxveh.io import kit
from jaxveh.sweeps.chunks import do_chunk, settings_of_jax
from jaxveh.sweeps.driving import Crew
from jaxveh.sweeps.workers import POOL

LOOK = 0.5
"""s between two checks of the parent."""

THREADS = "2"
"""Worker threads of a process: one computes, one is free for kernels on which it waits (see `sweeps/workers.py`)."""


@contextlib.contextmanager
def crew_for(client: Any, processes: int | None, packed: bytes, arguments: Callable[[int], tuple]) -> Iterator[Crew]:
    """The workers that the caller asked for; `arguments` gives those of a chunk by its number."""
    if client is not None:
        with _client(client) as connected:
            crew = Cluster(connected, packed, arguments)
            try:
                yield crew
            finally:
                crew.end()
        return
    check_whole("processes", processes)
    with tempfile.TemporaryDirectory(prefix="jaxveh-programs-") as folder:
        settings = settings_of_jax()
        if settings["jax_compilation_cache_dir"] is None:
            # One process compiles, the others read the compiled programs.
            settings["jax_compilation_cache_dir"] = folder
        crew = Processes(int(processes or 1), packed, arguments, settings)
        try:
            yield crew
        finally:
            crew.end()


def end_with(parent: int) -> None:
    """Run in a process of the crew: exit when the parent has gone, killed or not; loky's processes would wait for ever."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class Processes:
    """Processes of this machine; when one dies, all are restarted."""

    def __init__(self, count: int, packed: bytes, arguments: Callable[[int], tuple], settings: dict[str, Any]):
        self._loky = kit.require("loky", "a sweep in several processes", "sweep")
        self.workers, self._packed, self._arguments, self._settings = count, packed, arguments, settings
        self._pool = self._begin()

    def _begin(self) -> Any:
        flags = {name: os.environ[name] for name in ("XLA_FLAGS", "JAX_PLATFORMS") if name in os.environ}
        return self._loky.ProcessPoolExecutor(
            self.workers, env={**flags, POOL: THREADS}, initializer=end_with, initargs=(os.getpid(),)
        )

    def submit(self, number: int) -> Future:
        """Hand out a chunk."""
        try:
            return self._pool.submit(do_chunk, self._packed, number, self._arguments(number), self._settings)
        except (self._loky.process_executor.BrokenProcessPool, RuntimeError):
            self._again()
            return self._pool.submit(do_chunk, self._packed, number, self._arguments(number), self._settings)

    def drop(self, future: Future) -> None:
        """Restart all processes: loky cannot stop a single chunk."""
        self._again()

    def is_death(self, error: BaseException) -> bool:
        """Whether a process died."""
        return isinstance(
            error, self._loky.process_executor.BrokenProcessPool | self._loky.process_executor.ShutdownExecutorError
        )

    def _again(self) -> None:
        self.end()
        self._pool = self._begin()

    def end(self) -> None:
        """End all processes."""
        self._pool.shutdown(wait=True, kill_workers=True)


class Cluster:
    """The workers of a Dask scheduler. Each chunk carries everything that it needs: scattered data are lost with their
    worker."""

    def __init__(self, client: Any, packed: bytes, arguments: Callable[[int], tuple]):
        self._client, self._packed, self._arguments = client, packed, arguments
        self._distributed = kit.require("distributed", "a sweep on a cluster", "sweep")
        self._executor = client.get_executor(pure=False, retries=0)
        # A folder for compiled programs must be set here, if at all, and must be visible to the workers.
        self._settings = settings_of_jax()

    @property
    def workers(self) -> int:
        """Number of threads of all workers."""
        try:
            return sum(self._client.ncores().values())
        except Exception as error:
            raise InputError(
                f"sweep: the scheduler does not answer ({error}); finished chunks are kept: start again."
            ) from error

    def submit(self, number: int) -> Future:
        """Hand out a chunk."""
        return self._executor.submit(do_chunk, self._packed, number, self._arguments(number), self._settings)

    def drop(self, future: Future) -> None:
        """Cancel a chunk that takes too long."""
        future.cancel()

    def end(self) -> None:
        """Cancel the chunks that are still out, if the scheduler still answers."""
        with contextlib.suppress(Exception):
            self._executor.shutdown(wait=False)

    def is_death(self, error: BaseException) -> bool:
        """Whether a worker died, according to Dask."""
        return isinstance(error, self._distributed.scheduler.KilledWorker) or type(error).__name__ in (
            "KilledWorker", "FutureCancelledError", "CommClosedError",
        )  # fmt: skip


@contextlib.contextmanager
def _client(client: Any) -> Iterator[Any]:
    """The caller's client, or a new one for a scheduler's address."""
    if not isinstance(client, str):
        if not hasattr(client, "get_executor"):
            raise InputError(
                f"client = {client!r}: must be a dask.distributed Client, or a scheduler's address, tcp://host:8786."
            )
        yield client
        return
    distributed = kit.require("distributed", "a sweep on a cluster", "sweep")
    with distributed.Client(client, set_as_default=False) as made:
        yield made
