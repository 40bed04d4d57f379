"""A filter as two compiled programs in a folder, for use without this package."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax
import jax.export
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh.io import kit, making_folder
from jaxveh.statespace import AbstractFilter, Row, StateSpace
from jaxveh.statespace import kit as statespace

NUMBERS = ("log_likelihood", "nis", "ess", "result")


def export_filter(folder: str | Path, filter: AbstractFilter, model: StateSpace, *, key=None) -> Path:
    """Write `init.jaxexport`, `step.jaxexport` and `names.json` into a new `folder`, and return it.

    To use them, jax alone is needed (of a version near this one; see `jax.export`), on the platform that is the default here:

        init, step = (jax.export.deserialize(bytearray(open(f"{name}.jaxexport", "rb").read())) for name in ("init", "step"))
        state, *shown = init.call(t, u, y)
        state, *shown = step.call(state, t, u, y)

    `t` is a scalar, `u` (k,) and `y` (m,) arrays in the order of `names.json`, y NaN where missing, all in the precision of the
    model. `state` is a tuple of arrays, to be passed on unchanged. `shown`: mean and standard deviation of the report (r,), and
    `numbers` (4,): log-likelihood, NIS, ESS, result code. The model's parameters, and the `key` of a particle filter, are
    constants in the programs. With x64 arrays, jax_enable_x64 must be on there, too.

    **Raises** `InputError` where the folder exists already or cannot be written, and as `filter.check`.
    """
    statespace.check_told(filter, model)
    folder = Path(folder)
    if folder.exists():
        raise InputError(f"folder = {folder}: exists already; nothing is overwritten.")
    filter.check(model)
    kit.require("flatbuffers", "the file of an exported program", "export")
    dtype = model.dtype
    like = (
        jax.ShapeDtypeStruct((), dtype),
        jax.ShapeDtypeStruct((len(model.inputs),), dtype),
        jax.ShapeDtypeStruct((len(model.channels),), dtype),
    )
    structure: list[Any] = []
    names: list[Any] = []

    def shown(belief, info):
        mean, std = belief.moments(model)
        names.append(mean._fields)
        leaves, tree = jax.tree.flatten(belief)
        structure.append((tree, [_kind(leaf) for leaf in leaves]))
        numbers = jnp.stack([jnp.asarray(getattr(info, name), dtype) for name in NUMBERS])
        return tuple(_plain(leaf) for leaf in leaves), jnp.stack(mean), jnp.stack(std), numbers

    @jax.jit
    def init(t, u, y):
        return shown(*filter.init(model, _row(model, t, u, y), key))

    def step(state, t, u, y):
        tree, kinds = structure[0]
        leaves = [_restore_key(leaf, kind) for leaf, kind in zip(state, kinds, strict=True)]
        return shown(*filter.step(model, jax.tree.unflatten(tree, leaves), _row(model, t, u, y)))

    first = jax.export.export(init)(*like)
    state = jax.eval_shape(init, *like)[0]
    then = jax.export.export(jax.jit(step))(state, *like)
    described = {
        "inputs": model.inputs, "channels": model.channels, "report": names[0], "numbers": NUMBERS,
        "dtype": np.dtype(dtype).name, "jax": jax.__version__, "platforms": first.platforms,
    }  # fmt: skip
    with making_folder(folder) as part:
        (part / "init.jaxexport").write_bytes(first.serialize())
        (part / "step.jaxexport").write_bytes(then.serialize())
        (part / "names.json").write_text(json.dumps(described, indent=2) + "\n", encoding="utf-8")
    return folder


def _row(model: StateSpace, t, u, y) -> Row:
    inputs = record("Inputs", {name: u[i] for i, name in enumerate(model.inputs)})
    return Row(t, inputs, record("Measurements", {name: y[i] for i, name in enumerate(model.channels)}))


def _kind(leaf: Any) -> Any:
    """The generator of a key; None for an array."""
    return jax.random.key_impl(leaf) if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) else None


def _plain(leaf: Any) -> Any:
    return leaf if _kind(leaf) is None else jax.random.key_data(leaf)


def _restore_key(leaf: Any, kind: Any) -> Any:
    return leaf if kind is None else jax.random.wrap_key_data(leaf, impl=kind)
