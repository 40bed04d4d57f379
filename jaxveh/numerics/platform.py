"""The one place that decides, at trace time, between forms for the CPU and forms for an accelerator.

On the CPU XLA recomputes an expression in each consumer that it fuses it into, and its trigonometric functions are
slow; on an accelerator both are handled well. Everything in this package that differs by platform asks here.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

Tree = TypeVar("Tree")

_MANY = 128
"""From this size on computing a number twice costs more than storing it."""

_CACHED = 2**15
"""Bytes of an array of which a few dozen fit into a processor's own cache."""


def on_cpu() -> bool:
    """Whether code traced now is meant for the CPU: the platform of `jax_default_device`, else the default backend."""
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    if device is None:
        return jax.default_backend() == "cpu"
    return (device if isinstance(device, str) else device.platform) == "cpu"


def barriers_hold() -> bool:
    """Whether XLA keeps to a `barrier`: on the CPU before jax 0.12 it dissolves them, and fuses across.

    Only speed depends on this: forms that rely on a barrier (a concatenation of long expressions) have another without.
    """
    return not on_cpu() or jax.__version_info__ >= (0, 12)


def barrier(tree: Tree) -> Tree:
    """`tree`, which XLA on the CPU computes once and stores (from jax 0.12 on); on other platforms `tree` as it is.

    Place it on values with several consumers (a new state, weights, random words). It batches and differentiates in
    both modes; tangents and cotangents pass through barriers of their own.
    """
    return lax.optimization_barrier(tree) if on_cpu() else tree


def kept(tree: Tree) -> Tree:
    """`tree`, which XLA on the CPU computes once and stores as by a `barrier`, in every version of jax.

    For rates of hundreds of operations, where computing them twice costs more than the branch that replaces the barrier before
    jax 0.12: with it 1000 7-DOF cars take 175 instead of 400 ns a step there, and one takes 7.3 instead of 9.6 us.
    """
    leaves, structure = jax.tree.flatten(tree)
    if not on_cpu() or not leaves:
        return tree
    hold = lax.optimization_barrier if barriers_hold() else _hold_by_branch
    return jax.tree.unflatten(structure, hold(leaves))


def stored(tree: Tree) -> Tree:
    """`tree` with its arrays held in memory as by a `barrier`, those long enough to be worth it and short enough for the cache.

    For values with several consumers in an elementwise law of many terms: blocks of a batch are computed once, as are their
    cotangents, and a whole batch, which would have to go to memory and back, is still fused. Unlike a `barrier`, it holds in
    every version of jax.
    """
    leaves, structure = jax.tree.flatten(tree)
    some = [i for i, leaf in enumerate(leaves) if _worth_storing(leaf)]
    if some and on_cpu():
        hold = lax.optimization_barrier if barriers_hold() else _hold_by_branch
        for i, leaf in zip(some, hold([leaves[i] for i in some]), strict=True):
            leaves[i] = leaf
    return jax.tree.unflatten(structure, leaves)


def _worth_storing(leaf) -> bool:
    size = np.size(leaf)
    return size >= _MANY and size * leaf.dtype.itemsize <= _CACHED


_UNUSED_NAN = {"float32": (np.uint32, 0x7FDA_57ED), "float64": (np.uint64, 0x7FFA_57ED_57ED_57ED)}
"""Words of numbers that no calculation gives."""


def _hold_by_branch(leaves: list) -> list:
    """The same arrays, through a branch that is always taken but cannot be known to be: XLA fuses nothing across it.

    On jax 0.10 the gradient of MF-Tyre in blocks takes 610 instead of 1130 ns a contact, and 9 instead of 15 s to compile; an
    array that passes through costs 0.4 ns a number.
    """
    kinds = {str(leaf.dtype) for leaf in leaves}
    if len(kinds) > 1 or not kinds <= set(_UNUSED_NAN):
        return leaves
    kind, unused = _UNUSED_NAN[kinds.pop()]
    first = lax.bitcast_convert_type(lax.stop_gradient(leaves[0]).reshape(-1)[0], kind)
    keep, never = (lambda leaves: leaves), (lambda leaves: [jnp.full_like(leaf, jnp.nan) for leaf in leaves])
    return lax.cond(first != kind(unused), keep, never, leaves)
