"""Many runs in batches of one size, with progress between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_kind, check_whole
from jaxveh._core.progress import Progress
from jaxveh.statespace import StateSpace


def check_truth(model: StateSpace, truth: StateSpace) -> None:
    """Raise `InputError` unless the model that draws has the states, channels and inputs of the filter's model."""
    check_kind("truth", truth, StateSpace, "estimators.state_space returns one.")
    for what in ("states", "channels", "inputs"):
        ours, theirs = getattr(model, what), getattr(truth, what)
        if ours != theirs:
            raise InputError(
                f"truth: its {what} are {', '.join(theirs)}, the filter's model's {', '.join(ours)}: must agree."
            )


def in_batches(one_batch: Callable, key, runs: int, batch: int | None, progress: Progress, stage: str) -> Any:
    """The results of `one_batch(keys)` over the keys of all runs, `batch` runs at a time (None: all at once).

    Returns leaves (R, ...) on the host. The last batch is filled up, so that there is one size and one compilation.
    """
    batch = runs if batch is None else batch
    check_whole("batch", batch)
    batch = min(batch, runs)
    keys = jax.random.split(key, runs)
    found = []
    for first in range(0, runs, batch):
        progress(first, runs, stage)
        which = np.minimum(np.arange(first, first + batch), runs - 1)
        part = one_batch(keys if batch == runs else keys[jnp.asarray(which)])
        found.append(jax.tree.map(lambda leaf, n=min(batch, runs - first): np.asarray(leaf)[:n], part))
    progress(runs, runs, stage)
    return jax.tree.map(lambda *parts: np.concatenate(parts), *found)
