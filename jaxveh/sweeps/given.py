"""The arguments of the runs of a sweep: points of the design, keys, and parts of the data."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_key, check_whole
from jaxveh.sweeps.design import Design
from jaxveh.sweeps.swept import named_leaves


class Given:
    """The arguments of the runs of one choice, ordered by point, then by seed."""

    def __init__(self, design: Design, seeds: int | None, key: Any, data: Any):
        points = tuple(len(axis.values) for axis in design.numbers)
        parts = named_leaves(data)
        if key is None and not parts:
            raise InputError(
                "sweep: give seeds and a key, from which each run draws, or data, of which each run gets its part."
            )
        if key is not None:
            check_key("sweep", key)
        if seeds is None:
            seeds = next((np.shape(leaf)[len(points)] for leaf in parts.values() if np.ndim(leaf) > len(points)), None)
        check_whole("seeds", seeds)
        self.seeds, self.shape = int(seeds), (*points, int(seeds))
        self.runs = int(np.prod(self.shape))
        self.grid, self.data, self.key = design.grid(), data, key
        self.names = (*(("key",) if key is not None else ()), *(("data",) if data is not None else ()))
        self.keys = None if key is None else _on_the_host(jax.random.split(key, self.seeds))
        for name, leaf in parts.items():
            if np.shape(leaf)[: len(self.shape)] != self.shape:
                names = ", ".join([axis.name for axis in design.numbers] + ["seeds"])
                raise InputError(f"data {name} has shape {np.shape(leaf)}: must begin with {self.shape} ({names}).")

    def chunk(self, first: int, batch: int) -> tuple:
        """Arguments of the runs from `first` on; beyond the last run it is repeated."""
        return self.of_runs(np.minimum(np.arange(first, first + batch), self.runs - 1))

    def of_runs(self, which: np.ndarray) -> tuple:
        """Arguments of the runs of these numbers, each with (len(which), ...)."""
        place = np.unravel_index(which, self.shape)
        point = which // self.shape[-1]
        numbers = jax.tree.map(lambda values: jnp.asarray(values[point]), self.grid)
        keys = () if self.keys is None else (self.keys(place[-1]),)
        own = () if self.data is None else (jax.tree.map(lambda leaf: jnp.asarray(leaf[place]), self.data),)
        return numbers, *keys, *own


def _on_the_host(keys: jax.Array) -> Callable[[np.ndarray], jax.Array]:
    """A function that picks keys by number, in NumPy, so that nothing is compiled for it."""
    if not jnp.issubdtype(keys.dtype, jax.dtypes.prng_key):
        raw = np.asarray(keys)
        return lambda which: jnp.asarray(raw[which])
    words, impl = np.asarray(jax.random.key_data(keys)), jax.random.key_impl(keys)
    return lambda which: jax.random.wrap_key_data(jnp.asarray(words[which]), impl=impl)
