"""Small arrays as entries: NumPy arrays of objects, each of which is a traced scalar or a known number."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

Entries = np.ndarray
"""A NumPy array of dtype object with the entries of an array, in its shape; shape () for a scalar."""


def is_known(entry: Any) -> bool:
    """Whether an entry is already a number when the program is traced."""
    return isinstance(entry, np.generic)


def entries(array: Any) -> Entries:
    """The entries of an array: numbers if it is a NumPy array, otherwise traced scalars."""
    shape = np.shape(array)
    if isinstance(array, np.ndarray | np.generic):
        array = np.asarray(array)
    return of_list([array[index] for index in np.ndindex(shape)] if shape else [_scalar(array)], shape)


def _scalar(array: Any) -> Any:
    return array[()] if isinstance(array, np.ndarray) else array


def of_list(items: Sequence[Any], shape: tuple[int, ...]) -> Entries:
    """Entries of this shape from items in row-major order."""
    found = np.empty(len(items), object)
    for i, item in enumerate(items):
        found[i] = item
    return found.reshape(shape)


def entry_list(several: Iterable[Entries]) -> list[Any]:
    """The entries of several arrays, one after the other."""
    return [entry for one in several for entry in one.reshape(-1)]


def split(items: Sequence[Any], shapes: Sequence[tuple[int, ...]]) -> list[Entries]:
    """The inverse of `entry_list`: the items as entries of these shapes."""
    found, start = [], 0
    for shape in shapes:
        size = math.prod(shape)
        found.append(of_list(items[start : start + size], shape))
        start += size
    return found


def scalar_of(entry: Any, dtype: Any) -> Array:
    """An entry as a JAX scalar."""
    return jnp.asarray(entry, dtype) if is_known(entry) else entry


def array_of(those: Entries, dtype: Any) -> Array:
    """The array of these entries."""
    if not those.shape:
        return scalar_of(those[()], dtype)
    if not those.size:
        return jnp.zeros(those.shape, dtype)
    return jnp.stack([scalar_of(entry, dtype) for entry in those.reshape(-1)]).reshape(those.shape)
