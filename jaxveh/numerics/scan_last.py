"""Scans whose steps are computed for a whole batch with its axis last (`batch_last`), and their derivatives.

A scan is a primitive, so that its steps are taken in the form for one run until a batch of them is known.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend import core
from jax.interpreters import ad, batching, mlir

from jaxveh.numerics.batch_last import results_of_batch
from jaxveh.numerics.fences import fence
from jaxveh.numerics.last_axis import Last, wide
from jaxveh.numerics.steps_last import take_steps

PyTree = Any


def scan_batch_last(
    body: Callable, start: PyTree, rows: PyTree, *, reverse: bool = False, in_scalars: bool = False
) -> tuple[PyTree, PyTree]:
    """The result of `jax.lax.scan(body, start, rows, reverse=reverse)`, checkpointed; under `jax.vmap` with the batch's
    axis last.

    `rows` has at least one array. The scan is differentiable in both modes, like `body`. `in_scalars`: the body has been
    written out, so that the uses of its values tell where fences pay (`fences_by_use`).
    """
    carry, structure = jax.tree.flatten(start)
    leaves = jax.tree.leaves(rows)
    row = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(np.shape(leaf)[1:], leaf.dtype), rows)
    closed, shapes = jax.make_jaxpr(body, return_shape=True)(start, row)
    jaxpr = closed.jaxpr
    program = jaxpr.replace(
        constvars=[],
        invars=[*jaxpr.constvars, *jaxpr.invars],
        debug_info=jaxpr.debug_info.with_unknown_names(),
    )
    carry = [jnp.asarray(leaf, one.dtype) for leaf, one in zip(carry, closed.out_avals, strict=False)]
    found = _scan.bind(
        *closed.consts, *carry, *leaves,
        program=core.ClosedJaxpr(program, []), fixed=len(closed.consts), carried=len(carry), reverse=reverse,
        in_scalars=in_scalars,
    )  # fmt: skip
    end, stacked = jax.tree.unflatten(jax.tree.structure(shapes), found)
    return jax.tree.unflatten(structure, jax.tree.leaves(end)), stacked


def _parts(operands: Sequence[Any], fixed: int, carried: int) -> tuple[Sequence[Any], Sequence[Any], Sequence[Any]]:
    """The operands that every step has, the carry, and the rows."""
    return operands[:fixed], operands[fixed : fixed + carried], operands[fixed + carried :]


def _one_scan(*operands: Any, program: Any, fixed: int, carried: int, reverse: bool, in_scalars: bool) -> list:
    """The scan of one run."""
    del in_scalars
    always, carry, rows = _parts(operands, fixed, carried)

    def body(carry, row):
        found = core.jaxpr_as_fun(program)(*always, *carry, *row)
        return found[:carried], found[carried:]

    end, shown = lax.scan(jax.checkpoint(body, prevent_cse=False), list(carry), list(rows), reverse=reverse)
    return [*end, *shown]


def _batch_of_scans(
    operands, axes, *, program, fixed: int, carried: int, reverse: bool, in_scalars: bool
) -> tuple[list, list]:
    """The scan of a batch."""
    size = next(one.shape[axis] for one, axis in zip(operands, axes, strict=True) if axis is not None)
    shapes = [one.shape for one in program.out_avals]
    moved = [one if axis is None else jnp.moveaxis(one, axis, -1) for one, axis in zip(operands, axes, strict=True)]
    always, carry, rows = _parts(moved, fixed, carried)
    of_batch, results = _spread([axis is not None for axis in axes], program, fixed, carried)
    _, of_carry, _ = _parts(of_batch, fixed, carried)
    start = [
        wide(one if axis is None else Last(one), shape, size) if last else one
        for one, axis, shape, last in zip(carry, axes[fixed:], shapes, of_carry, strict=False)
    ]
    shared = _shared(of_batch, results, program, fixed, carried)
    repeated = [wide(always[i], program.in_avals[i].shape, size) for i in shared]

    def body(carry, row):
        found = take_steps(
            (*always, *carry, *row), repeated, program=program, of_batch=of_batch, results=results, size=size,
            shared=shared, in_scalars=in_scalars,
        )  # fmt: skip
        # Values that the next row uses are computed once.
        return fence(found[:carried]), found[carried:]

    end, shown = lax.scan(body, start, list(rows), reverse=reverse)
    found = [*end, *shown]
    return found, [one.ndim - 1 if last else None for one, last in zip(found, results, strict=True)]


def _spread(of_batch: list[bool], program: Any, fixed: int, carried: int) -> tuple[list[bool], list[bool]]:
    """Which operands and results of a step are of the batch, after any number of steps."""
    while True:
        results = results_of_batch(program, of_batch)
        always, carry, rows = _parts(of_batch, fixed, carried)
        more = [a or b for a, b in zip(carry, results, strict=False)]
        results = [*more, *results[carried:]]
        if more == carry:
            return of_batch, results
        of_batch = [*always, *more, *rows]


def _shared(of_batch: list[bool], results: list[bool], program: Any, fixed: int, carried: int) -> list[int]:
    """The places of operands that all runs share and on which only results of the batch depend."""
    floating = [jnp.issubdtype(one.dtype, jnp.inexact) for one in program.in_avals[:fixed]]
    places = [i for i in range(fixed) if floating[i] and not of_batch[i]]
    as_if = [last or i in places for i, last in enumerate(of_batch)]
    return places if _spread(as_if, program, fixed, carried)[1] == results else []


_scan = core.Primitive("jaxveh_scan")
_scan.multiple_results = True
_scan.def_impl(_one_scan)
_scan.def_abstract_eval(
    lambda *avals, **how: [
        jax.core.ShapedArray(one.shape, one.dtype)
        for one in jax.eval_shape(functools.partial(_one_scan, **how), *avals)
    ]
)
mlir.register_lowering(_scan, mlir.lower_fun(_one_scan, multiple_results=True))
batching.primitive_batchers[_scan] = _batch_of_scans
ad.primitive_jvps[_scan] = lambda primals, tangents, **how: jax.jvp(
    functools.partial(_one_scan, **how), tuple(primals), tuple(ad.instantiate_zeros(one) for one in tangents)
)
