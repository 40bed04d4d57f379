"""The `jaxveh` command: thin programs over the library; every number they show can be had by calling it."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from jaxveh.cli.family import end_with_parent

__all__ = ["main"]

VECTOR_WIDTH = "--xla_cpu_prefer_vector_width"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line (`sys.argv` by default) and exit: 0 done, 1 a filter or a fit failed, 2 bad input."""
    end_with_parent()
    prepare()
    try:
        from jaxveh.cli.app import app
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("typer", "rich"):
            raise
        print(f'error: {error.name} is not installed: run `pip install "jaxveh[cli,io,plot]"`.', file=sys.stderr)
        raise SystemExit(2) from None
    app(args=None if arguments is None else list(arguments), prog_name="jaxveh")


def prepare() -> None:
    """Wide vectors (unless XLA_FLAGS says otherwise) and float64: before anything is computed, and in programs only."""
    flags = os.environ.get("XLA_FLAGS", "")
    if VECTOR_WIDTH not in flags:
        # XLA reads its flags when the first computation starts, which importing jax is not.
        os.environ["XLA_FLAGS"] = f"{flags} {VECTOR_WIDTH}=512".strip()
    import jax

    jax.config.update("jax_enable_x64", True)
