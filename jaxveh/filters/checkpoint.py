"""Beliefs in files, so that a run can stop and continue with the same bits."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, path_of
from jaxveh.io import replacing_file
from jaxveh.statespace import AbstractBelief

STATES = "states"
"""The file's entry for the names of the states. No path into a belief is called so: a path starts with a dot."""

B = TypeVar("B", bound=AbstractBelief)


def save_belief(path: str | Path, belief: AbstractBelief) -> Path:
    """Write a belief to a NumPy archive (.npz): every array by its place in the belief, random keys as their integers.

    `load_belief` reads it; the steps that follow equal those of an unbroken run, bit for bit. An existing file is
    replaced only when the new one is complete. Returns the path.

    **Raises** `InputError` for another suffix, or where the file cannot be written.
    """
    path = path_of(path)
    if path.suffix != ".npz":
        raise InputError(f"path = {path}: must end in .npz.")
    arrays = {name: np.asarray(_words(leaf)) for name, leaf in _leaves_by_name(belief).items()}
    arrays[STATES] = np.asarray(_states(belief))
    with replacing_file(path, overwrite=True) as part:
        np.savez(part, **arrays)
    return path


def load_belief(path: str | Path, like: B) -> B:
    """Read a belief that `save_belief` wrote; `like` is a belief of the same filter and model, such as the one after
    the first row.

    **Raises** `InputError` if the file is of another filter, number of particles, model or precision; it names the difference.
    """
    path = path_of(path)
    if not path.is_file():
        raise InputError(f"path = {path}: there is no such file.")
    expected = _leaves_by_name(like)
    try:
        with np.load(path) as archive:
            arrays = dict(archive)
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: is not a file of save_belief ({error}).") from error
    states, own = tuple(map(str, arrays.pop(STATES, ()))), _states(like)
    if states != own:
        raise InputError(
            f"{path}: its states are {', '.join(states)}, expected {', '.join(own)}: it is of another model."
        )
    for name in sorted(set(arrays) ^ set(expected)):
        where = "the file has" if name in arrays else "the file lacks"
        raise InputError(f"{path}: {where} {name}: it is of another filter or model.")
    leaves = []
    for name, leaf in expected.items():
        words, found = _words(leaf), arrays[name]
        if found.shape != words.shape or found.dtype != words.dtype:
            raise InputError(
                f"{path}: {name} is {found.dtype}{list(found.shape)}, expected {words.dtype}{list(words.shape)}: "
                "it is of another size or precision."
            )
        value = jnp.asarray(found)
        leaves.append(jax.random.wrap_key_data(value, impl=jax.random.key_impl(leaf)) if _is_key(leaf) else value)
    return jax.tree.unflatten(jax.tree.structure(like), leaves)


def _states(belief: Any) -> tuple[str, ...]:
    """The names of the states, empty if the belief has no mean."""
    try:
        return eqx.filter_eval_shape(lambda belief: belief.mean, belief)._fields
    except InputError:
        return ()


def _leaves_by_name(belief: Any) -> dict[str, Any]:
    return {jax.tree_util.keystr(path): leaf for path, leaf in jax.tree_util.tree_leaves_with_path(belief)}


def _is_key(leaf: Any) -> bool:
    return jnp.issubdtype(jnp.result_type(leaf), jax.dtypes.prng_key)


def _words(leaf: Any) -> Any:
    return jax.random.key_data(leaf) if _is_key(leaf) else jnp.asarray(leaf)
