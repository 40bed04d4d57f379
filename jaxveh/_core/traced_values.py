"""Where Python or NumPy asks for the value of a traced number: a message with the line of the user's own that did it."""

from __future__ import annotations

import traceback
from pathlib import Path
from typing import NoReturn

import equinox as eqx
import jax
import numpy as np

from jaxveh._core.errors import InputError

NO_VALUE = (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError)
"""The errors of jax where a number has no value yet."""

PACKAGE = str(Path(__file__).parents[1])
LIBRARIES = tuple(str(Path(one.__file__).parent) for one in (jax, np, eqx))
"""The folders of this package, and of those that an error passes through."""

REMEDY = (
    "asks for the value of a number that has none while jax traces the program. Write jnp.where for `if`, and jax.numpy "
    "for numpy, math and float()."
)
"""What is wrong, and the remedy, where Python or NumPy meets a tracer."""


def raise_with_place(error: Exception) -> NoReturn:
    """Raise an error of `NO_VALUE` as an `InputError` that names the place, or again as it is if that is of the package."""
    place = _place(error)
    if place is None:
        raise error
    raise InputError(f"{place}: {REMEDY}") from error


def _place(error: BaseException) -> str | None:
    """The line of the user's own that led to an error, None if it was of the package."""
    frames = [one for one in traceback.extract_tb(error.__traceback__) if not one.filename.startswith(LIBRARIES)]
    if not frames or frames[-1].filename.startswith(PACKAGE):
        return None
    return f"{frames[-1].filename}, line {frames[-1].lineno}, in {frames[-1].name}"
