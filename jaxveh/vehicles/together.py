"""Long tyre laws evaluated for several wheels by one call: only inside the call there is an axis of wheels.

Wheels are named scalars because that is fast for laws of a few operations. MF-Tyre has a thousand, and its copies in each stage
of a solver take minutes to compile. One copy over an axis of four wheels runs as fast (a 7-DOF car on MF-Tyres: 44 s of
processor time to the first result with four copies, 18 s with one; a simulated second takes 0.06 s in both cases).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.tyres import AbstractTyre, MFTyre
from jaxveh.vehicles.base import dtype_of_strong


def long_law(tyre: AbstractTyre) -> bool:
    """Whether a tyre's law is so long that it should have few copies: whether it contains an MF-Tyre."""
    is_mf = lambda node: isinstance(node, MFTyre)
    return any(is_mf(node) for node in jax.tree.leaves(tyre, is_leaf=is_mf))


def alike(*tyres: AbstractTyre) -> bool:
    """Whether tyres have the same law with different numbers, so that one call can evaluate all of them."""
    parts = [eqx.partition(tyre, eqx.is_array) for tyre in tyres]
    shapes = [jax.tree.map(jnp.shape, arrays) for arrays, _ in parts]
    return all(
        bool(eqx.tree_equal(rest, parts[0][1])) and shape == shapes[0]
        for (_, rest), shape in zip(parts, shapes, strict=True)
    )


def together(function: Callable[..., Any], tyres: tuple, *per_wheel: tuple) -> list:
    """`function(tyre, ...)` for each wheel by one call, given n `tyres` (see `alike`) and n values of each other argument.

    Everything is stacked along a new leading axis of length n, before the axes of the batch. A Python number or None that is the
    same for all wheels is not stacked.
    """
    n = len(tyres)
    shape = jnp.broadcast_shapes(*[jnp.shape(leaf) for leaf in jax.tree.leaves(per_wheel)])
    dtype = dtype_of_strong(jax.tree.leaves(per_wheel))
    stacked = [jax.tree.map(lambda *leaves: _stack(leaves, shape, dtype), *values) for values in per_wheel]
    found = function(_one(tyres, len(shape)), *stacked)
    part = lambda leaf, i: jnp.broadcast_to(leaf, (n, *shape))[i] if eqx.is_array(leaf) else leaf
    return [jax.tree.map(lambda leaf, i=i: part(leaf, i), found) for i in range(n)]


def _stack(leaves: tuple, shape: tuple, dtype: Any) -> Any:
    """The leaves along a new leading axis; Python numbers get the `dtype` of the other arrays, as they would in a formula."""
    if not any(eqx.is_array(leaf) for leaf in leaves) and all(leaf == leaves[0] for leaf in leaves):
        return leaves[0]
    dtype = dtype_of_strong(leaves, dtype)
    return jnp.stack([jnp.broadcast_to(jnp.asarray(leaf, dtype), shape) for leaf in leaves])


def _one(tyres: tuple, batch: int) -> AbstractTyre:
    """One tyre whose numbers have the axis of wheels; the tyre itself if all wheels have the same object."""
    if all(tyre is tyres[0] for tyre in tyres):
        return tyres[0]

    def stack(*leaves):
        if not eqx.is_array(leaves[0]):
            return leaves[0]
        values = jnp.stack(leaves)
        return values.reshape(len(leaves), *(1,) * (batch - leaves[0].ndim), *leaves[0].shape)

    return jax.tree.map(stack, *tyres)
