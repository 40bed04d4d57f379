"""Scans whose steps are written out in scalars (`written_out`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh.numerics.entries import array_of, entries, entry_list, split
from jaxveh.numerics.fences import fence
from jaxveh.numerics.scan_last import scan_batch_last
from jaxveh.numerics.written_out import evaluate, scalars_from

PyTree = Any


def scan_written_out(
    body: Callable, start: PyTree, rows: PyTree, *, reverse: bool = False, complete: bool = False
) -> tuple[PyTree, PyTree]:
    """The result of `jax.lax.scan(body, start, rows, reverse=reverse)`, with the body written out in scalars and checkpointed.

    `rows` has at least one array. The carry is written out in scalars, too. The scan is differentiable in both modes,
    like `body`; a product of a known zero and NaN is zero. `complete`: every number of `rows` is finite, so that values
    that depend only on missing measurements are known when traced.
    """
    carried, structure = jax.tree.flatten(start)
    row = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(np.shape(leaf)[1:], leaf.dtype), rows)
    closed, shapes = jax.make_jaxpr(body, return_shape=True)(start, row)
    results = [jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(shapes)]
    inner, outer = results[: len(carried)], results[len(carried) :]

    def scalars(carry: list, row: PyTree) -> tuple[list, list]:
        given = [entries(leaf) for leaf in jax.tree.leaves(row)]
        found = evaluate(
            closed, split(carry, [one.shape for one in inner]) + given, entry_list(given) if complete else ()
        )
        # Values that the next row uses are computed once.
        return fence(scalars_from(found[: len(inner)], inner)), scalars_from(found[len(inner) :], outer)

    first = scalars_from([entries(leaf) for leaf in carried], inner)
    last, columns = scan_batch_last(scalars, first, rows, reverse=reverse, in_scalars=True)
    end = [array_of(those, one.dtype) for those, one in zip(split(last, [o.shape for o in inner]), inner, strict=True)]
    count = len(jax.tree.leaves(rows)[0])
    shown = [
        jnp.stack(some.tolist(), axis=1).reshape(count, *one.shape)
        if some.size
        else jnp.zeros((count, *one.shape), one.dtype)
        for some, one in zip(split(columns, [(math.prod(o.shape),) for o in outer]), outer, strict=True)
    ]
    carry, stacked = jax.tree.unflatten(jax.tree.structure(shapes), [*end, *shown])
    return jax.tree.unflatten(structure, jax.tree.leaves(carry)), stacked
