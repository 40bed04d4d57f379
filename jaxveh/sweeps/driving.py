"""Hands chunks to other processes, until each is done or has failed three times."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from typing import Any, Protocol

from jaxveh._core.errors import InputError, warn
from jaxveh.sweeps.chunks import Unfit

TRIES = 3
"""Most failures of a chunk."""

LOSSES = 50
"""Most deaths of workers under one chunk before it counts as failed; the chunk need not be their cause."""

AHEAD = 2
"""Chunks that wait at each worker, so that no worker is idle between two chunks."""

NOBODY = "sweep: the cluster has no worker; the chunks wait until one comes. Finished chunks are kept if you stop here."

POLL = 1.0
"""Seconds between two checks of the time limits."""


class Crew(Protocol):
    """Workers that compute chunks."""

    @property
    def workers(self) -> int:
        """Number of chunks computed at once."""
        ...

    def submit(self, number: int) -> Future:
        """Hand out a chunk."""
        ...

    def drop(self, future: Future) -> None:
        """Cancel a chunk that takes too long."""
        ...

    def is_death(self, error: BaseException) -> bool:
        """Whether an error means that a worker died, rather than an error in its chunk; new workers then take its place."""
        ...


def drive(
    crew: Crew,
    numbers: Iterable[int],
    limit: float,
    on_done: Callable[[int], Any],
    on_failure: Callable[[int, str], Any],
) -> None:
    """Let the crew compute all chunks, each within `limit` seconds of its start at most.

    If there is no worker, as on a cluster that has yet to start them, wait for one and warn.
    """
    waiting = list(reversed(list(numbers)))
    failed: dict[int, int] = {}
    lost: dict[int, int] = {}
    out: dict[Future, tuple[int, float]] = {}
    is_told = False

    def again(number: int, count: dict[int, int], most: int, error: object) -> None:
        count[number] = count.get(number, 0) + 1
        if count[number] < most:
            waiting.append(number)
        else:
            on_failure(number, str(error) or type(error).__name__)

    while waiting or out:
        before = time.monotonic()
        while waiting and len(out) < AHEAD * max(1, crew.workers):
            number = waiting.pop()
            # A chunk that waits behind others also gets their time.
            out[crew.submit(number)] = (number, time.monotonic() + AHEAD * limit)
        ready, _ = wait(out, timeout=POLL, return_when=FIRST_COMPLETED)
        for future in ready:
            number, _ = out.pop(future)
            error = CancelledError() if future.cancelled() else future.exception()
            if error is None:
                on_done(number)
            elif isinstance(error, Unfit):
                raise InputError(f"sweep: a worker does not fit: {error}.")
            elif isinstance(error, OSError) and not crew.is_death(error):
                raise InputError(
                    f"sweep: a chunk cannot be written: {error}. Finished chunks are kept: start again."
                ) from error
            elif isinstance(error, CancelledError) or crew.is_death(error):
                again(number, lost, LOSSES, error)
            else:
                again(number, failed, TRIES, error)
        now = time.monotonic()
        if crew.workers == 0:
            # No worker computes: chunks that are out keep their time.
            out = {future: (number, end + now - before) for future, (number, end) in out.items()}
            if not is_told:
                warn(NOBODY)
        is_told = crew.workers == 0
        for future in [f for f, (_, end) in out.items() if now > end]:
            number, _ = out.pop(future)
            crew.drop(future)
            again(number, failed, TRIES, f"took longer than {limit:g} s")
