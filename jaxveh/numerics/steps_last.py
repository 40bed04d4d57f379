"""A step of a scan for a whole batch with its axis last (`batch_last`), as a primitive, and its derivatives.

A step is a primitive, so that it is differentiated in the form for one run, and its derivative is also computed with
the batch last. (The derivatives of sums that are written out are sums of arrays of zeros with one slice in each: with
them, 256 gradients of an unscented filter of 11 states took 20 times as long.)

Of a step of a batch of `size`, `of_batch` marks the operands and `results` the results that have the batch's axis. The
last operands are those at the places `shared` once more, repeated for each run: a step does not read them, but the
cotangents of what all runs share go to them, so that the sum over the runs is taken once and not in every step. A program
`in_scalars` has been written out.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend import core
from jax.interpreters import ad, batching, mlir

from jaxveh.numerics.batch_last import as_last, evaluate
from jaxveh.numerics.fences_by_use import fence_by_use
from jaxveh.numerics.last_axis import wide
from jaxveh.numerics.platform import barriers_hold, on_cpu


def like(one: Any, of_batch: bool, size: int) -> jax.ShapeDtypeStruct:
    """The shape and dtype of a value of one run, with the batch's axis if it is `of_batch`."""
    return jax.ShapeDtypeStruct((*one.shape, size) if of_batch else one.shape, one.dtype)


def take_steps(
    operands: Sequence[Any], repeated: Sequence[Any], *, program: Any, of_batch: Sequence[bool], results: Sequence[bool],
    size: int, shared: Sequence[int], in_scalars: bool,
) -> list:  # fmt: skip
    """The results of a program of one run for each run of a batch; `repeated` are the operands at the places `shared`."""
    return _steps.bind(
        *operands, *repeated, program=program, of_batch=tuple(of_batch), results=tuple(results), size=size,
        shared=tuple(shared), in_scalars=in_scalars,
    )  # fmt: skip


def _stepped(
    *operands: Any, program: Any, of_batch: tuple, results: tuple, size: int, shared: tuple, in_scalars: bool
) -> list:
    """The results of the program."""
    del shared

    def stepped(*operands):
        found = evaluate(program, as_last(operands, of_batch), size)
        return [
            wide(one, kind.shape, size) if last else jnp.asarray(one, kind.dtype)
            for one, kind, last in zip(found, program.out_avals, results, strict=True)
        ]

    operands = operands[: len(of_batch)]
    if not (in_scalars and on_cpu() and barriers_hold()):
        return stepped(*operands)
    return core.jaxpr_as_fun(fence_by_use(jax.make_jaxpr(stepped)(*operands)))(*operands)


def _slopes(
    primals, tangents, *, program, of_batch: tuple, results: tuple, size: int, shared: tuple, in_scalars: bool
) -> tuple[list, list]:
    """The values of a step and their slopes, which are computed by another step."""
    count = len(of_batch)
    operands, repeated = primals[:count], primals[count:]
    values = take_steps(
        operands, repeated, program=program, of_batch=of_batch, results=results, size=size, shared=shared,
        in_scalars=in_scalars,
    )  # fmt: skip
    tangents = _with(tangents[:count], shared, tangents[count:])
    moves = [i for i, tangent in enumerate(tangents) if not isinstance(tangent, ad.Zero)]
    slopes = [ad.Zero(jax.core.ShapedArray(one.shape, jax.dtypes.float0)) for one in values]
    floating = [i for i, one in enumerate(program.out_avals) if jnp.issubdtype(one.dtype, jnp.inexact)]
    found = take_steps(
        (*operands, *(tangents[i] for i in moves)), repeated,
        program=_pushforward(program, tuple(moves), tuple(floating)),
        of_batch=(*of_batch, *(of_batch[i] or i in shared for i in moves)), results=[results[i] for i in floating],
        size=size, shared=shared, in_scalars=in_scalars,
    )  # fmt: skip
    for i, slope in zip(floating, found, strict=True):
        slopes[i] = slope
    return values, slopes


def _back(
    cotangents, *operands, program, of_batch: tuple, results: tuple, size: int, shared: tuple, in_scalars: bool
) -> list:
    """The cotangents of the operands in which the step is linear."""
    count = len(of_batch)
    linear = [i for i in range(count) if ad.is_undefined_primal(operands[i])]
    known = [i for i in range(count) if i not in linear]
    given = [i for i, one in enumerate(cotangents) if not isinstance(one, ad.Zero)]
    # A result that is the same for all runs gives each run its share of the cotangent: those of the runs are summed below.
    shares = [cotangents[i] if results[i] else cotangents[i] / size for i in given]
    found = take_steps(
        (*(operands[i] for i in known), *shares), operands[count:],
        program=_pullback(program, tuple(linear), tuple(given)),
        of_batch=(*(of_batch[i] for i in known), *(results[i] for i in given)), results=(True,) * len(linear), size=size,
        shared=[known.index(i) for i in shared], in_scalars=in_scalars,
    )  # fmt: skip
    out: list[Any] = [None] * len(operands)
    for i, one in zip(linear, found, strict=True):
        out[i] = one if of_batch[i] else jnp.sum(one, axis=-1)
    return out


@functools.lru_cache(maxsize=32)
def _pushforward(program: Any, moves: tuple[int, ...], floating: tuple[int, ...]) -> Any:
    """The slopes of the `floating` results as a program of all operands and of the tangents of the operands `moves`."""
    avals = [like(one, False, 0) for one in program.in_avals]

    def slopes(*operands):
        def value(*moving):
            found = core.jaxpr_as_fun(program)(*_with(operands[: len(avals)], moves, moving))
            return [found[i] for i in floating]

        return jax.jvp(value, tuple(operands[i] for i in moves), tuple(operands[len(avals) :]))[1]

    return jax.make_jaxpr(slopes)(*avals, *(avals[i] for i in moves))


@functools.lru_cache(maxsize=32)
def _pullback(program: Any, linear: tuple[int, ...], given: tuple[int, ...]) -> Any:
    """The cotangents of the `linear` operands as a program of the other operands and the cotangents of the `given` results."""
    avals = [like(one, False, 0) for one in program.in_avals]
    known = [i for i in range(len(avals)) if i not in linear]

    def pulled(*operands):
        def value(*some):
            full = _with(_with([None] * len(avals), known, operands[: len(known)]), linear, some)
            found = core.jaxpr_as_fun(program)(*full)
            return [found[i] for i in given]

        zeros = (jnp.zeros(avals[i].shape, avals[i].dtype) for i in linear)
        return jax.vjp(value, *zeros)[1](list(operands[len(known) :]))

    return jax.make_jaxpr(pulled)(*(avals[i] for i in known), *(like(program.out_avals[i], False, 0) for i in given))


def _with(several: Sequence[Any], places: Sequence[int], others: Sequence[Any]) -> list:
    found = list(several)
    for i, one in zip(places, others, strict=True):
        found[i] = one
    return found


def _batch_of_steps(
    operands, axes, *, program, of_batch: tuple, results: tuple, size: int, shared: tuple, in_scalars: bool
) -> tuple[list, list]:
    """A batch of batches as one batch, of which all operands are."""
    del shared
    outer = next(one.shape[axis] for one, axis in zip(operands, axes, strict=True) if axis is not None)
    merged = []
    for one, axis, last, kind in zip(operands, axes, of_batch, program.in_avals, strict=False):
        first = one[None] if axis is None else jnp.moveaxis(one, axis, 0)
        both = jnp.moveaxis(first, 0, -2) if last else jnp.moveaxis(first, 0, -1)[..., None]
        merged.append(jnp.broadcast_to(both, (*kind.shape, outer, size)).reshape(*kind.shape, outer * size))
    found = take_steps(
        merged, (), program=program, of_batch=(True,) * len(merged), results=(True,) * len(results), size=outer * size,
        shared=(), in_scalars=in_scalars,
    )  # fmt: skip
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
