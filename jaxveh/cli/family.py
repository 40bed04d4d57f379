"""Child programs of a program: they all end when it ends, however it ends.

The standard input of each child is a pipe to which nothing is written. It closes when the parent has ended, killed or not;
the child then ends itself.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from typing import IO

ENDS_WITH_INPUT = "JAXVEH_ENDS_WITH_INPUT"
"""The environment variable that makes a child end when its standard input closes."""

GRACE = 5.0
"""Time for which an interrupted child may tidy up, s, before it ends at once."""


class Family:
    """The child programs of a program."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen] = []
        self._ended = False
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def child(self, command: Sequence[str], stdout: IO, **variables: str) -> Iterator[subprocess.Popen]:
        """Start a program whose messages are a pipe of text, and wait for its end.

        `variables` are set in its environment, unless they are set already.
        """
        with self._lock:
            if self._ended:
                raise KeyboardInterrupt
            child = subprocess.Popen(
                list(command), stdin=subprocess.PIPE, stdout=stdout, stderr=subprocess.PIPE, text=True,
                env={**variables, **os.environ, ENDS_WITH_INPUT: "1"},
            )  # fmt: skip
            self._running.append(child)
        try:
            yield child
            child.wait()
        finally:
            with self._lock:
                self._running.remove(child)
            for pipe in (child.stdin, child.stderr):
                if pipe is not None:
                    pipe.close()

    def end(self) -> None:
        """End all children, and start no more."""
        with self._lock:
            self._ended = True
            for child in self._running:
                if child.stdin is not None:
                    child.stdin.close()


@contextlib.contextmanager
def ends_in_order() -> Iterator[None]:
    """Turn SIGTERM and SIGHUP into exits (128 plus the signal's number) that run `finally`; only the main thread can do this."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number, frame):
        raise SystemExit(128 + number)

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    usual = {number: signal.signal(number, leave) for number in numbers}
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)


def end_with_parent() -> None:
    """In a child: interrupt this process when its standard input closes, and force its end if that does not suffice."""
    if os.environ.pop(ENDS_WITH_INPUT, None) is None:
        return

    def watch() -> None:
        while os.read(0, 1024):  # not sys.stdin, whose lock an interpreter that is ending could not acquire
            pass
        done = threading.Event()
        os.kill(os.getpid(), signal.SIGINT)
        done.wait(GRACE)
        os._exit(130)

    threading.Thread(target=watch, daemon=True).start()
