"""The one place that decides, at trace time, between forms for the CPU and forms for an accelerator.

On the CPU XLA recomputes an expression in each consumer that it fuses it into, and its trigonometric functions are
slow; on an accelerator both are handled well. Everything in this package that differs by platform asks here.
"""

from typing import TypeVar

import jax
from jax import lax

from jaxveh._core.errors import is_concrete
from jaxveh.numerics.held import held

Tree = TypeVar("Tree")


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
    return _held(tree, worth=False)


def stored(tree: Tree) -> Tree:
    """`tree` with its arrays held in memory as by a `barrier`, those long enough to be worth it and short enough for the cache.

    For values with several consumers in an elementwise law of many terms: blocks of a batch are computed once, as are their
    cotangents, and a whole batch, which would have to go to memory and back, is still fused. Unlike a `barrier`, it holds in
    every version of jax.
    """
    return _held(tree, worth=True)


def _held(tree: Tree, worth: bool) -> Tree:
    leaves, structure = jax.tree.flatten(tree)
    # A plain number stays one, so that checks on the host can still look at it.
    traced = [i for i, leaf in enumerate(leaves) if not is_concrete(leaf)]
    if traced and on_cpu():
        found = held([leaves[i] for i in traced], worth=worth, barrier=barriers_hold())
        for i, leaf in zip(traced, found, strict=True):
            leaves[i] = leaf
    return jax.tree.unflatten(structure, leaves)
