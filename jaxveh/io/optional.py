"""Optional libraries, imported where they are used."""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from typing import Any

from jaxveh._core.errors import InputError


def require(module: str, purpose: str, extra: str = "io") -> Any:
    """The module, or an `InputError` that says what needs it and how to install it."""
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
    """Finalizers of asammdf and h5netcdf fail on a file that they could not open; Python would print that beside our error."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        yield
    finally:
        sys.unraisablehook = hook
