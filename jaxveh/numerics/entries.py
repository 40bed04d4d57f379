"""Small arrays as their entries: NumPy arrays of objects, each a traced scalar or a number that is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

Entries = np.ndarray
"""Of dtype object and of the shape of the array whose entries it has; of shape () for a scalar."""


def is_known(entry: Any) -> bool:
    """Whether an entry is a number when the program is traced."""
    return isinstance(entry, np.generic)


def entries(array: Any) -> Entries:
    """The entries of an array: numbers of a NumPy array, else scalars."""
    shape = np.shape(array)
    if isinstance(array, np.ndarray | np.generic):
        array = np.asarray(array)
    return of_list([array[index] for index in np.ndindex(shape)] if shape else [_scalar(array)], shape)


def _scalar(array: Any) -> Any:
    return array[()] if isinstance(array, np.ndarray) else array


def of_list(items: Sequence[Any], shape: tuple[int, ...]) -> Entries:
    """Entries in row-major order."""
    found = np.empty(len(items), object)
    for i, item in enumerate(items):
        found[i] = item
    return found.reshape(shape)


def entry_list(several: Iterable[Entries]) -> list[Any]:
    """The entries of several arrays, one after the other."""
    return [entry for one in several for entry in one.reshape(-1)]


def split(items: Sequence[Any], shapes: Sequence[tuple[int, ...]]) -> list[Entries]:
    """The inverse of `entry_list`."""
    found, start = [], 0
    for shape in shapes:
        size = math.prod(shape)
        found.append(of_list(items[start : start + size], shape))
        start += size
    return found


def scalar_of(entry: Any, dtype: Any) -> Array:
    """An entry as a scalar of JAX."""
    return jnp.asarray(entry, dtype) if is_known(entry) else entry


def array_of(those: Entries, dtype: Any) -> Array:
    """The array of these entries."""
    if not those.shape:
        return scalar_of(those[()], dtype)
    if not those.size:
        return jnp.zeros(those.shape, dtype)
    return jnp.stack([scalar_of(entry, dtype) for entry in those.reshape(-1)]).reshape(those.shape)
