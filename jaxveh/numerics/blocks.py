"""Sums over long tables and their gradients, block by block."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jaxveh._core.errors import InputError
from jaxveh.numerics.platform import on_cpu


def sum_in_blocks(function: Callable[[Any, Any], Array], parameters: Any, rows: Any, *, block: int = 1000) -> Array:
    """The sum of `function(parameters, rows)` over all rows, with a gradient that is computed block by block.

    For fits to long tables, such as `sum_in_blocks(lambda tyre, rig: (tyre.forces(rig.contact).F_y - rig.F_y) ** 2, tyre, rig)`:
    the value is that of `jnp.sum(function(parameters, rows))`; its gradient takes about a third of the time on a CPU and a
    fortieth of the memory (MF-Tyre 6.1 with all coefficients, 1e5 rows: 450 instead of 1620 ns per row with jax 0.12, 610
    instead of 1650 with 0.10, where the forces alone take 120; 5 instead of 200 MB), because intermediate results stay in the
    processor's cache and slopes of parameters are not summed number by number. It takes longer to compile (12 instead of 7 s).

    `function`: elementwise; arrays (n,) in, one array (n,) out. Everything that is differentiated must be an argument of it, not
    in its closure. `parameters`: a pytree, such as a tyre; within a block its scalars are arrays as long as the block. `rows`: a
    pytree of arrays (n,), and of scalars that are the same for all rows. `block`: the number of rows at a time on a CPU; an
    accelerator takes all at once. The result is a scalar. Both modes of differentiation and higher orders work, and so does
    `jax.vmap`; the gradient with respect to rows is computed only if it is needed.

    **Raises** `InputError` for a block of less than one row, or rows that are not arrays of one length.
    """
    if block < 1:
        raise InputError(f"block = {block}: must be at least 1.")
    shapes = {jnp.shape(leaf) for leaf in jax.tree.leaves(rows)} - {()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise InputError(f"rows: shapes {sorted(shapes)}; must be arrays (n,) of one length.")
    return _sum(parameters, rows, function=function, block=block)


@eqx.filter_custom_jvp
def _sum(parameters, rows, *, function, block):
    return jnp.sum(function(parameters, rows))


@_sum.def_jvp
def _sum_jvp(primals, tangents, *, function, block):
    primal, tree = jax.tree.flatten(primals, is_leaf=lambda leaf: leaf is None)
    tangent = jax.tree.leaves(tangents, is_leaf=lambda leaf: leaf is None)
    chosen = [i for i, one in enumerate(tangent) if one is not None]
    count = len(jax.tree.leaves(primals[0], is_leaf=lambda leaf: leaf is None))
    tabled = [i >= count and np.ndim(leaf) == 1 for i, leaf in enumerate(primal)]

    def law(leaves):
        return function(*jax.tree.unflatten(tree, leaves))

    value, gradient = _with_gradient(law, primal, chosen, tabled, block)
    return value, sum(jnp.sum(slope * tangent[i]) for i, slope in zip(chosen, gradient, strict=True))


def _with_gradient(law, primal: list, chosen: list[int], tabled: list[bool], block: int):
    """The sum of `law(primal)` and its gradients with respect to the `chosen` leaves; leaves are rows where `tabled`."""
    rows = next(len(leaf) for leaf, is_row in zip(primal, tabled, strict=True) if is_row)
    blocks = -(-rows // block) if on_cpu() else 1
    size = -(-rows // blocks)
    # Rows after the end repeat the last one and are not counted.
    fill = (0, blocks * size - rows)
    counts = jnp.arange(blocks * size).reshape(blocks, size) < rows
    table = [
        jnp.pad(x, fill, mode="edge").reshape(blocks, size) for x, is_row in zip(primal, tabled, strict=True) if is_row
    ]
    wide = [i for i in chosen if not tabled[i]]

    def step(carry, given):
        some, counted = given
        some = iter(some)
        leaves = [next(some) if is_row else leaf for leaf, is_row in zip(primal, tabled, strict=True)]
        # Scalars are broadcast to the block: their slopes are added elementwise, and summed once at the end.
        moving = [jnp.broadcast_to(leaves[i], (size,)) if jnp.ndim(leaves[i]) == 0 else leaves[i] for i in chosen]

        def of(moving):
            for i, leaf in zip(chosen, moving, strict=True):
                leaves[i] = leaf
            return law(leaves)

        value, pull = jax.vjp(of, moving)
        slopes = dict(zip(chosen, pull(counted.astype(value.dtype))[0], strict=True))
        total, sums = carry
        total = total + jnp.where(counted, value, 0)
        return (total, [a + slopes[i] for a, i in zip(sums, wide, strict=True)]), [
            slopes[i] for i in chosen if tabled[i]
        ]

    dtype = jax.eval_shape(law, primal).dtype
    zeros = [jnp.zeros(jnp.shape(primal[i]) or (size,), primal[i].dtype) for i in wide]
    (total, sums), along = lax.scan(step, (jnp.zeros(size, dtype), zeros), (table, counts))
    found = {i: jnp.sum(s) if jnp.ndim(primal[i]) == 0 else s for i, s in zip(wide, sums, strict=True)}
    found |= {i: s.reshape(-1)[:rows] for i, s in zip([i for i in chosen if tabled[i]], along, strict=True)}
    return jnp.sum(total), [found[i] for i in chosen]
