"""Optional libraries, imported when they are used."""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from typing import Any

from jaxveh._core.errors import InputError


def require(module: str, purpose: str, extra: str = "io") -> Any:
    """Import a module; if it is missing, raise `InputError` with the `purpose` that needs it and the `extra` that installs it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = module.partition(".")[0]
        if error.name is not None and error.name.partition(".")[0] != library:
            raise
        raise InputError(
            f'{library} is not installed, and {purpose} needs it: run `pip install "jaxveh[{extra}]"`.'
        ) from error


@contextlib.contextmanager
def quiet_finalizers() -> Iterator[None]:
    """Silence the finalizers of asammdf and h5netcdf, which fail on a file that they could not open and would print errors."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        yield
    finally:
        sys.unraisablehook = hook
