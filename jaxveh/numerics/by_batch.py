"""Two forms of one function: one for a single call, the other for a batch of calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

LEAST, BLOCK = 64, 256
"""The least and the largest number of calls of a batch at a time: the data of so many stay in a processor's own cache."""

RUNS = "jaxveh_runs"
"""Name of the batch's axis inside the form for many: `jax.lax.pmax(x, RUNS)` is the largest value of a block's calls."""

LANES = 8
"""The width of a block is a multiple of this: a remainder beside whole vectors would be computed one by one."""


def by_batch(single: Callable, many: Callable, *operands: Any, least: int = 1, most: int = BLOCK) -> Any:
    """`single(*operands)`; under `jax.vmap`, `many(*operands)` for each call of the batch, in blocks of at most `most`.

    A batch of fewer than `least` calls uses `single`, too, unless further `jax.vmap`s around it make it large enough.
    Both must be pure functions of pytrees without traced values in their closures, and must give the same results
    except for rounding: they differ only in speed. If a single call is differentiated, in a batch or not, `single` is
    used; if a batch is differentiated as a whole (such as a sum of many log-likelihoods), `many` is used.
    """
    arrays, rest = eqx.partition(operands, eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)
    given = lambda some: eqx.combine(jax.tree.unflatten(structure, some), rest)
    shapes: list[Any] = []

    def flat(function):
        def called(*some):
            found, other = eqx.partition(function(*given(some)), eqx.is_array)
            found, form = jax.tree.flatten(found)
            shapes[:] = [(form, other)]
            return found

        return called

    out = jax.eval_shape(flat(single), *leaves)
    kinds = tuple((o.shape, o.dtype) for o in out)
    found = _by_batch.bind(*leaves, single=flat(single), many=flat(many), out=kinds, least=least, most=most)
    form, other = shapes[0]
    return eqx.combine(jax.tree.unflatten(form, found), other)


def _batched(leaves, axes, *, single, many, out, least, most):
    """The form for many; if there are too few calls, both forms batched once more, because an outer batch may be larger."""
    size = next(leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None)
    leaves = [leaf if axis is None else jnp.moveaxis(leaf, axis, 0) for leaf, axis in zip(leaves, axes, strict=True)]
    along = [None if axis is None else 0 for axis in axes]
    if size == 0:
        # No number of further calls makes such a batch large enough.
        found = jax.vmap(single, in_axes=along)(*leaves)
        return found, [0] * len(found)
    if size >= least:
        return _in_blocks(leaves, along, size, many, most)
    one, more = jax.vmap(single, in_axes=along), lambda *some: _in_blocks(some, along, size, many, most)[0]
    kinds = tuple(((size, *shape), dtype) for shape, dtype in out)
    found = _by_batch.bind(*leaves, single=one, many=more, out=kinds, least=-(-least // size), most=most)
    return found, [0] * len(found)


def _in_blocks(leaves, axes, size, many, most):
    """The results of `many` in blocks, one after the other; a last block that is not full repeats its last call."""
    whole = jax.vmap(many, in_axes=axes, axis_name=RUNS)
    blocks, width = blocks_of(size, most)
    if blocks == 1:
        found = whole(*leaves)
        return found, [0] * len(found)
    fill = blocks * width - size

    def cut(leaf):
        leaf = jnp.concatenate([leaf, jnp.repeat(leaf[-1:], fill, axis=0)]) if fill else leaf
        return leaf.reshape(blocks, width, *leaf.shape[1:])

    def block(some):
        some = iter(some)
        return whole(*(leaf if axis is None else next(some) for leaf, axis in zip(leaves, axes, strict=True)))

    moving = [cut(leaf) for leaf, axis in zip(leaves, axes, strict=True) if axis is not None]
    joined = [one.reshape(blocks * width, *one.shape[2:]) for one in lax.map(block, moving)]
    return [one[:size] if fill else one for one in joined], [0] * len(joined)


def blocks_of(size: int, most: int = BLOCK) -> tuple[int, int]:
    """The number of blocks of a batch and the number of calls in each; without a remainder if possible, as results are
    copied for one."""
    fewest = -(-size // most)
    if fewest == 1:
        return 1, size
    for blocks in range(fewest, size // min(LEAST, most) + 1):
        if size % blocks == 0 and size // blocks % LANES == 0:
            return blocks, size // blocks
    return fewest, -(-size // (fewest * LANES)) * LANES


def _jvp(primals, tangents, *, single, many, out, least, most):
    """Values and slopes with respect to the operands that have tangents, by the form for a single call."""
    del many, out, least, most
    moves = [i for i, tangent in enumerate(tangents) if not isinstance(tangent, ad.Zero)]

    def function(*some):
        leaves = list(primals)
        for i, leaf in zip(moves, some, strict=True):
            leaves[i] = leaf
        return single(*leaves)

    values, slopes = jax.jvp(function, tuple(primals[i] for i in moves), tuple(tangents[i] for i in moves))
    float0 = jax.dtypes.float0
    no_slope = lambda value, slope: (
        ad.Zero(jax.core.ShapedArray(value.shape, float0)) if slope.dtype == float0 else slope
    )
    return values, [no_slope(value, slope) for value, slope in zip(values, slopes, strict=True)]


_by_batch = Primitive("jaxveh_by_batch")
_by_batch.multiple_results = True
_by_batch.def_impl(lambda *leaves, single, **rest: single(*leaves))
_by_batch.def_abstract_eval(lambda *avals, out, **rest: [jax.core.ShapedArray(shape, dtype) for shape, dtype in out])
mlir.register_lowering(
    _by_batch, mlir.lower_fun(lambda *leaves, single, **rest: single(*leaves), multiple_results=True)
)
batching.primitive_batchers[_by_batch] = _batched
ad.primitive_jvps[_by_batch] = _jvp
