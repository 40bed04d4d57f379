"""Scans whose steps are computed for a whole batch with its axis last (`batch_last`), and their derivatives.

A step is a primitive, so that it is differentiated in the form for one run, and its derivative is also computed with
the batch last. (The derivatives of sums that are written out are sums of arrays of zeros with one slice in each: with
them, 256 gradients of an unscented filter of 11 states took 20 times as long.)
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

from jaxveh.numerics.batch_last import as_last, evaluate
from jaxveh.numerics.fences import fence
from jaxveh.numerics.last_axis import Last, wide

PyTree = Any


def scan_batch_last(body: Callable, start: PyTree, rows: PyTree, *, reverse: bool = False) -> tuple[PyTree, PyTree]:
    """The result of `jax.lax.scan(body, start, rows, reverse=reverse)`, checkpointed; under `jax.vmap` with the batch's
    axis last.

    `rows` has at least one array. The scan is differentiable in both modes, like `body`.
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
    )  # fmt: skip
    end, stacked = jax.tree.unflatten(jax.tree.structure(shapes), found)
    return jax.tree.unflatten(structure, jax.tree.leaves(end)), stacked


def _parts(operands: Sequence[Any], fixed: int, carried: int) -> tuple[Sequence[Any], Sequence[Any], Sequence[Any]]:
    """The operands that every step has, the carry, and the rows."""
    return operands[:fixed], operands[fixed : fixed + carried], operands[fixed + carried :]


def _one_scan(*operands: Any, program: Any, fixed: int, carried: int, reverse: bool) -> list:
    """The scan of one run."""
    always, carry, rows = _parts(operands, fixed, carried)

    def body(carry, row):
        found = core.jaxpr_as_fun(program)(*always, *carry, *row)
        return found[:carried], found[carried:]

    end, shown = lax.scan(jax.checkpoint(body, prevent_cse=False), list(carry), list(rows), reverse=reverse)
    return [*end, *shown]


def _batch_of_scans(operands, axes, *, program, fixed: int, carried: int, reverse: bool) -> tuple[list, list]:
    """The scan of a batch."""
    size = next(one.shape[axis] for one, axis in zip(operands, axes, strict=True) if axis is not None)
    shapes = [one.shape for one in program.out_avals]
    moved = [one if axis is None else jnp.moveaxis(one, axis, -1) for one, axis in zip(operands, axes, strict=True)]
    always, carry, rows = _parts(moved, fixed, carried)
    of_batch, results = _spread([axis is not None for axis in axes], program, fixed, carried, size)
    _, of_carry, _ = _parts(of_batch, fixed, carried)
    start = [
        wide(one if axis is None else Last(one), shape, size) if last else one
        for one, axis, shape, last in zip(carry, axes[fixed:], shapes, of_carry, strict=False)
    ]

    def body(carry, row):
        found = _steps.bind(
            *always, *carry, *row, program=program, of_batch=tuple(of_batch), results=tuple(results), size=size
        )
        # Values that the next row uses are computed once.
        return fence(found[:carried]), found[carried:]

    end, shown = lax.scan(body, start, list(rows), reverse=reverse)
    found = [*end, *shown]
    return found, [one.ndim - 1 if last else None for one, last in zip(found, results, strict=True)]


def _spread(of_batch: list[bool], program: Any, fixed: int, carried: int, size: int) -> tuple[list[bool], list[bool]]:
    """Which operands and results of a step are batched, after any number of steps."""
    while True:
        results: list[bool] = []

        def step(*some, of_batch=of_batch, results=results):
            found = evaluate(program, as_last(some, of_batch), size)
            results[:] = [isinstance(one, Last) for one in found]
            return [one.array if isinstance(one, Last) else one for one in found]

        jax.eval_shape(step, *(_like(one, last, size) for one, last in zip(program.in_avals, of_batch, strict=True)))
        always, carry, rows = _parts(of_batch, fixed, carried)
        more = [a or b for a, b in zip(carry, results, strict=False)]
        results = [*more, *results[carried:]]
        if more == carry:
            return of_batch, results
        of_batch = [*always, *more, *rows]


def _like(one: Any, of_batch: bool, size: int) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((*one.shape, size) if of_batch else one.shape, one.dtype)


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


# A step of a batch of `size`: `of_batch` marks the operands and `results` the results that have the batch's axis.


def _stepped(*operands: Any, program: Any, of_batch: tuple, results: tuple, size: int) -> list:
    """The results of the program."""
    found = evaluate(program, as_last(operands, of_batch), size)
    return [
        wide(one, like.shape, size) if last else jnp.asarray(one, like.dtype)
        for one, like, last in zip(found, program.out_avals, results, strict=True)
    ]


def _slopes(primals, tangents, *, program, of_batch: tuple, results: tuple, size: int) -> tuple[list, list]:
    """The values of a step and their slopes, which are computed by another step."""
    values = _steps.bind(*primals, program=program, of_batch=of_batch, results=results, size=size)
    moves = [i for i, tangent in enumerate(tangents) if not isinstance(tangent, ad.Zero)]
    slopes = [ad.Zero(jax.core.ShapedArray(one.shape, jax.dtypes.float0)) for one in values]
    floating = [i for i, one in enumerate(program.out_avals) if jnp.issubdtype(one.dtype, jnp.inexact)]
    found = _steps.bind(
        *primals, *(tangents[i] for i in moves), program=_pushforward(program, tuple(moves), tuple(floating)),
        of_batch=(*of_batch, *(of_batch[i] for i in moves)), results=tuple(results[i] for i in floating), size=size,
    )  # fmt: skip
    for i, slope in zip(floating, found, strict=True):
        slopes[i] = slope
    return values, slopes


def _back(cotangents, *operands, program, of_batch: tuple, results: tuple, size: int) -> list:
    """The cotangents of the operands in which the step is linear."""
    linear = [i for i, one in enumerate(operands) if ad.is_undefined_primal(one)]
    known = [i for i in range(len(operands)) if i not in linear]
    given = [i for i, one in enumerate(cotangents) if not isinstance(one, ad.Zero)]
    # A result that is the same for all runs gives each run its share of the cotangent: those of the runs are summed below.
    shares = [cotangents[i] if results[i] else cotangents[i] / size for i in given]
    found = _steps.bind(
        *(operands[i] for i in known), *shares,
        program=_pullback(program, tuple(linear), tuple(given)),
        of_batch=(*(of_batch[i] for i in known), *(results[i] for i in given)), results=(True,) * len(linear), size=size,
    )  # fmt: skip
    out: list[Any] = [None] * len(operands)
    for i, one in zip(linear, found, strict=True):
        out[i] = one if of_batch[i] else jnp.sum(one, axis=-1)
    return out


@functools.lru_cache(maxsize=32)
def _pushforward(program: Any, moves: tuple[int, ...], floating: tuple[int, ...]) -> Any:
    """The slopes of the `floating` results as a program of all operands and of the tangents of the operands `moves`."""
    avals = [_like(one, False, 0) for one in program.in_avals]

    def slopes(*operands):
        def value(*moving):
            found = core.jaxpr_as_fun(program)(*_with(operands[: len(avals)], moves, moving))
            return [found[i] for i in floating]

        return jax.jvp(value, tuple(operands[i] for i in moves), tuple(operands[len(avals) :]))[1]

    return jax.make_jaxpr(slopes)(*avals, *(avals[i] for i in moves))


@functools.lru_cache(maxsize=32)
def _pullback(program: Any, linear: tuple[int, ...], given: tuple[int, ...]) -> Any:
    """The cotangents of the `linear` operands as a program of the other operands and the cotangents of the `given` results."""
    avals = [_like(one, False, 0) for one in program.in_avals]
    known = [i for i in range(len(avals)) if i not in linear]

    def pulled(*operands):
        def value(*some):
            full = _with(_with([None] * len(avals), known, operands[: len(known)]), linear, some)
            found = core.jaxpr_as_fun(program)(*full)
            return [found[i] for i in given]

        zeros = (jnp.zeros(avals[i].shape, avals[i].dtype) for i in linear)
        return jax.vjp(value, *zeros)[1](list(operands[len(known) :]))

    return jax.make_jaxpr(pulled)(*(avals[i] for i in known), *(_like(program.out_avals[i], False, 0) for i in given))


def _with(several: Sequence[Any], places: Sequence[int], others: Sequence[Any]) -> list:
    found = list(several)
    for i, one in zip(places, others, strict=True):
        found[i] = one
    return found


def _batch_of_steps(operands, axes, *, program, of_batch: tuple, results: tuple, size: int) -> tuple[list, list]:
    """A batch of batches as one batch."""
    outer = next(one.shape[axis] for one, axis in zip(operands, axes, strict=True) if axis is not None)
    merged = []
    for one, axis, last, like in zip(operands, axes, of_batch, program.in_avals, strict=True):
        first = one[None] if axis is None else jnp.moveaxis(one, axis, 0)
        both = jnp.moveaxis(first, 0, -2) if last else jnp.moveaxis(first, 0, -1)[..., None]
        merged.append(jnp.broadcast_to(both, (*like.shape, outer, size)).reshape(*like.shape, outer * size))
    found = _steps.bind(
        *merged, program=program, of_batch=(True,) * len(merged), results=(True,) * len(results), size=outer * size
    )
    apart = [one.reshape(*one.shape[:-1], outer, size) for one in found]
    shown = [one if last else one[..., 0] for one, last in zip(apart, results, strict=True)]
    return shown, [one.ndim - 2 if last else one.ndim - 1 for one, last in zip(shown, results, strict=True)]


_steps = core.Primitive("jaxveh_steps")
_steps.multiple_results = True
_steps.def_impl(_stepped)
_steps.def_abstract_eval(
    lambda *avals, program, results, size, **how: [
        jax.core.ShapedArray((*one.shape, size) if last else one.shape, one.dtype)
        for one, last in zip(program.out_avals, results, strict=True)
    ]
)
mlir.register_lowering(_steps, mlir.lower_fun(_stepped, multiple_results=True))
batching.primitive_batchers[_steps] = _batch_of_steps
ad.primitive_jvps[_steps] = _slopes
ad.primitive_transposes[_steps] = _back
