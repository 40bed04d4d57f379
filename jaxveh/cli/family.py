"""Programs that a program starts: none goes on when it ends, however it ends.

Each child's standard input is a pipe that nobody writes to. It closes when the parent is gone, killed or not, and the child
ends itself then.
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
"""The variable that tells a child to end when its standard input does."""

GRACE = 5.0
"""How long an interrupted child may tidy up, s, before it leaves at once."""


class Family:
    """The children of a program."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen] = []
        self._ended = False
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def child(self, command: Sequence[str], stdout: IO, **variables: str) -> Iterator[subprocess.Popen]:
        """Start a program whose messages are a pipe of text, and wait for its end; `variables` of the environment hold where
        nobody has set them."""
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
        """End all children, and let none begin any more."""
        with self._lock:
            self._ended = True
            for child in self._running:
                if child.stdin is not None:
                    child.stdin.close()


@contextlib.contextmanager
def ends_in_order() -> Iterator[None]:
    """Make SIGTERM and SIGHUP exits (of 128 and their number) on which `finally` is run; in the main thread, which hears them."""
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
    """In a child: interrupt this process when its standard input ends, and leave if that does not end it."""
    if os.environ.pop(ENDS_WITH_INPUT, None) is None:
        return

    def watch() -> None:
        while os.read(0, 1024):  # not sys.stdin, whose lock an ending interpreter would not get
            pass
        done = threading.Event()
        os.kill(os.getpid(), signal.SIGINT)
        done.wait(GRACE)
        os._exit(130)

    threading.Thread(target=watch, daemon=True).start()
