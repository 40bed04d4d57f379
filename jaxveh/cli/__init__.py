"""The `jaxveh` command: thin programs over the library, whose functions give every number that they show."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from jaxveh.cli.family import end_with_parent
from jaxveh.cli.kept_programs import keep_programs

__all__ = ["main"]

CLI_LIBRARIES = ("typer", "rich", "platformdirs")

VECTOR_WIDTH = "--xla_cpu_prefer_vector_width"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line (`sys.argv` by default) and end the process: 0 done, 1 a filter or a fit failed, 2 bad input."""
    end_with_parent()
    try:
        prepare()
        from jaxveh.cli.app import app
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in CLI_LIBRARIES:
            raise
        print(f'error: {error.name} is not installed: run `pip install "jaxveh[cli,io,plot]"`.', file=sys.stderr)
        raise SystemExit(2) from None
    try:
        app(args=None if arguments is None else list(arguments), prog_name="jaxveh")
    except SystemExit as end:
        leave(end)


def leave(end: SystemExit) -> NoReturn:
    """End the process at once: deleting hundreds of compiled programs one by one takes up to a second."""
    if not (end.code is None or isinstance(end.code, int)):
        raise end
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(end.code or 0)


def prepare() -> None:
    """Set wide vectors (unless XLA_FLAGS sets a width), float64, and a cache of compiled programs, before anything is computed.

    Programs alone do this; the library changes no such setting.
    """
    # Traces and programs are many long-lived objects: the garbage collector's search for cycles took a tenth of the run time.
    gc.set_threshold(200_000, 20, 50)
    flags = os.environ.get("XLA_FLAGS", "")
    if VECTOR_WIDTH not in flags:
        # XLA reads its flags when the first computation starts; importing jax does not read them.
        os.environ["XLA_FLAGS"] = f"{flags} {VECTOR_WIDTH}=512".strip()
    import jax

    jax.config.update("jax_enable_x64", True)
    keep_programs()
