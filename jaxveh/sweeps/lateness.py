"""A warning about a chunk that takes long: nothing is stopped, but the user learns what is running."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

from jaxveh._core.errors import warn


@contextlib.contextmanager
def warn_when_late(what: str, patience: float | None) -> Iterator[None]:
    """Warn each time that the block has taken another `patience` seconds (None: never); `what` is its name in the warning."""
    if patience is None:
        yield
        return
    ended = threading.Event()
    watcher = threading.Thread(target=_watch, args=(what, patience, ended), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()


def _watch(what: str, patience: float, ended: threading.Event) -> None:
    times = 1
    while not ended.wait(patience):
        warn(
            f"sweep: {what} has not finished for {times * patience:g} s. If the processor is busy, it may only be slow: a "
            "smaller batch= reports progress more often. If the processor is idle, it will never end: stop it, and run "
            "again on one device (devices=jax.devices()[:1], or JAX_NUM_CPU_DEVICES=1 in the environment)."
        )
        times += 1
