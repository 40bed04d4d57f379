"""Scans in batches whose axis is the last one of every array, along which XLA's loops then run.

Under `jax.vmap` a batch stands first, and XLA on the CPU takes its small matrices one by one: sums over 11 numbers are short
loops, and each Cholesky factor is a call of LAPACK. What `written_out` does for a few states in scalars would take too long to
compile for more.
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

from jaxveh.numerics import entry_rules, last_axis
from jaxveh.numerics.fences import fence
from jaxveh.numerics.last_axis import Last, Product, wide
from jaxveh.numerics.platform import on_cpu
from jaxveh.numerics.written_out import CALLS, FENCES, alone, is_ruled

PyTree = Any


def scan_batch_last(body: Callable, start: PyTree, rows: PyTree, *, reverse: bool = False) -> tuple[PyTree, PyTree]:
    """What `jax.lax.scan(body, start, rows, reverse=reverse)` gives, checkpointed; under `jax.vmap` with the batch's axis last.

    `rows` has at least one array. Differentiable, in both modes, as `body` is.
    """
    carry, structure = jax.tree.flatten(start)
    leaves = jax.tree.leaves(rows)
    row = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(np.shape(leaf)[1:], leaf.dtype), rows)
    closed, shapes = jax.make_jaxpr(body, return_shape=True)(start, row)
    carry = [jnp.asarray(leaf, one.dtype) for leaf, one in zip(carry, closed.out_avals, strict=False)]
    program = core.ClosedJaxpr(closed.jaxpr.replace(
        constvars=[], invars=[*closed.jaxpr.constvars, *closed.jaxpr.invars], debug_info=closed.jaxpr.debug_info.with_unknown_names()
    ), [])
    found = _scan.bind(
        *closed.consts, *carry, *leaves, program=program, fixed=len(closed.consts), carried=len(carry), reverse=reverse
    )
    end, stacked = jax.tree.unflatten(jax.tree.structure(shapes), found)
    return jax.tree.unflatten(structure, jax.tree.leaves(end)), stacked


def _plain(*operands: Any, program: Any, fixed: int, carried: int, reverse: bool) -> list:
    """The scan as it is."""
    fixed_ones, carry, rows = operands[:fixed], operands[fixed : fixed + carried], operands[fixed + carried :]

    def body(carry, row):
        found = core.jaxpr_as_fun(program)(*fixed_ones, *carry, *row)
        return found[:carried], found[carried:]

    end, shown = lax.scan(jax.checkpoint(body, prevent_cse=False), list(carry), list(rows), reverse=reverse)
    return [*end, *shown]


def _batched(operands: Sequence[Any], axes: Sequence[Any], **how: Any) -> tuple[list, list]:
    """The scan of a batch."""
    program, fixed, carried, reverse = (how[name] for name in ("program", "fixed", "carried", "reverse"))
    size = next(one.shape[axis] for one, axis in zip(operands, axes, strict=True) if axis is not None)
    moved = [
        one if axis is None else Last(jnp.moveaxis(one, axis, -1)) for one, axis in zip(operands, axes, strict=True)
    ]
    fixed_ones, carry, rows = moved[:fixed], moved[fixed : fixed + carried], moved[fixed + carried :]
    of_rows = [isinstance(one, Last) for one in rows]
    shapes = [one.shape for one in program.out_avals]

    def body(of_carry, seen, carry, row):
        given = [*fixed_ones, *_boxed(carry, of_carry), *_boxed(row, of_rows)]
        found = evaluate(program, given, size)
        seen[:] = [isinstance(one, Last) for one in found]
        kinds = [*(a or b for a, b in zip(of_carry, seen, strict=False)), *seen[carried:]]
        found = [
            wide(one, shape, size) if last else jnp.asarray(one)
            for one, shape, last in zip(found, shapes, kinds, strict=True)
        ]
        # What the next row reads is computed once.
        return fence(found[:carried]), found[carried:]

    # What of the carry is the same for the whole batch, after however many steps.
    of_carry, seen = [isinstance(one, Last) for one in carry], []
    plain = lambda some: [one.array if isinstance(one, Last) else one for one in some]
    while True:
        start = [
            wide(one, shape, size) if last else one for one, shape, last in zip(carry, shapes, of_carry, strict=False)
        ]
        first = [one[0] for one in plain(rows)]
        jax.eval_shape(functools.partial(body, of_carry, seen), start, first)
        more = [a or b for a, b in zip(of_carry, seen, strict=False)]
        if more == of_carry:
            break
        of_carry = more
    steps = jax.checkpoint(functools.partial(body, of_carry, seen), prevent_cse=False)
    end, shown = lax.scan(steps, start, plain(rows), reverse=reverse)
    found = [*end, *shown]
    kinds = [*of_carry, *seen[carried:]]
    return found, [one.ndim - 1 if last else None for one, last in zip(found, kinds, strict=True)]


def _boxed(arrays: Sequence[Any], of_batch: Sequence[bool]) -> list:
    return [Last(one) if last else one for one, last in zip(arrays, of_batch, strict=True)]


def evaluate(program: Any, operands: Sequence[Any], size: int) -> list:
    """The results of a closed jaxpr for operands that are `Last`, or the same for the whole batch."""
    jaxpr = program.jaxpr if hasattr(program, "jaxpr") else program
    values: dict[Any, Any] = {}
    read = lambda one: np.asarray(one.val, one.aval.dtype) if isinstance(one, core.Literal) else values[one]
    values.update(zip(jaxpr.constvars, getattr(program, "consts", ()), strict=True))
    values.update(zip(jaxpr.invars, operands, strict=True))
    summed = _only_summed(jaxpr)
    for equation in jaxpr.eqns:
        given = [read(one) for one in equation.invars]
        if equation.primitive.name == "mul" and equation.outvars[0] in summed:
            shape = equation.outvars[0].aval.shape
            if any(isinstance(one, Last) for one in given):
                values[equation.outvars[0]] = Product(tuple(wide(one, shape, size) for one in given))
                continue
        values.update(zip(equation.outvars, _results(equation, given, size), strict=True))
    return [read(one) for one in jaxpr.outvars]


def _only_summed(jaxpr: Any) -> set:
    """Variables that one sum reads, and nothing else."""
    readers: dict[Any, list] = {}
    for equation in jaxpr.eqns:
        for one in equation.invars:
            if not isinstance(one, core.Literal):
                readers.setdefault(one, []).append(equation.primitive.name)
    results = {one for one in jaxpr.outvars if not isinstance(one, core.Literal)}
    return {one for one, names in readers.items() if names == ["reduce_sum"] and one not in results}


def _results(equation: Any, operands: list, size: int) -> list:
    """The results of one equation."""
    name, params = equation.primitive.name, equation.params
    out = [one.aval for one in equation.outvars]
    if not any(isinstance(one, Last | Product) for one in operands):
        return _for_all(equation, operands)
    if name in entry_rules.REDUCTIONS:
        return [Last(_reduced(equation, operands[0]))]
    if name in entry_rules.ELEMENTWISE:
        how = dict(params, sharding=None) if "sharding" in params else params
        return [Last(equation.primitive.bind(*(wide(one, out[0].shape, size) for one in operands), **how))]
    if name in CALLS:
        return evaluate(params["jaxpr"], operands, size)
    if name in FENCES:
        arrays = [one.array if isinstance(one, Last) else jnp.asarray(one) for one in operands]
        return _boxed(equation.primitive.bind(*arrays, **params), [isinstance(one, Last) for one in operands])
    if name == "cond" and not isinstance(operands[0], Last):
        return _branches(params, operands, out, size)
    if name == "custom_jvp_call" and is_ruled(params, equation):
        return _with_rule(params, operands, out, size)
    if name == "gather" and not isinstance(operands[1], Last):
        return [Last(last_axis.gather(params, operands[0].array, operands[1], out[0].shape))]
    rule = last_axis.MOVES.get(name) or last_axis.ALGEBRA.get(name)
    if rule is not None:
        arrays = [wide(one, var.aval.shape, size) for one, var in zip(operands, equation.invars, strict=True)]
        found = rule(params, arrays, out)
        if name == "dot_general" and found is not None: found = fence(found, firm=True)
        if found is not None:
            return [Last(one) for one in (found if isinstance(found, list) else [found])]
    return _by_vmap(equation, operands)


def _reduced(equation: Any, operand: Any) -> Any:
    axes = tuple(equation.params["axes"])
    array = operand if isinstance(operand, Product) else operand.array
    if not axes:
        return array
    found = last_axis.reduction(entry_rules.REDUCTIONS[equation.primitive.name][1], axes, array)
    if found is not None:
        return fence(found, firm=True)
    if isinstance(array, Product):
        array = array.factors[0] * array.factors[1]
    return equation.primitive.bind(array, **equation.params)


def _variables(equation: Any, operands: list) -> dict[Any, Any]:
    """The values of an equation's variables, each once."""
    return {
        one: value
        for one, value in zip(equation.invars, operands, strict=True)
        if not isinstance(one, core.Literal)
    }


def _for_all(equation: Any, operands: list) -> list:
    """An equation of what is the same for the whole batch."""
    values = _variables(equation, operands)
    return core.jaxpr_as_fun(alone(equation, list(values)))(*values.values())


def _by_vmap(equation: Any, operands: list) -> list:
    """An equation that nothing is known of here."""
    print("BY VMAP", equation.primitive.name)
    values = _variables(equation, operands)
    axes = [-1 if isinstance(one, Last) else None for one in values.values()]
    arrays = [one.array if isinstance(one, Last) else one for one in values.values()]
    # Else each number would be computed from the beginning, with all that it is made of.
    found = jax.vmap(core.jaxpr_as_fun(alone(equation, list(values))), axes, -1)(*fence(arrays))
    return [Last(one) for one in fence(found)]


def _branches(params: dict[str, Any], operands: list, out: list, size: int) -> list:
    """A conditional of one predicate for the whole batch."""
    index, *rest = operands
    of_batch = [isinstance(one, Last) for one in rest]
    arrays = [one.array if last else one for one, last in zip(rest, of_batch, strict=True)]

    def taken(branch):
        def run(*some):
            found = evaluate(branch, _boxed(some, of_batch), size)
            return [wide(one, like.shape, size) for one, like in zip(found, out, strict=True)]

        return run

    platforms = params.get("branches_platforms")
    if platforms is not None:
        here = "cpu" if on_cpu() else jax.default_backend()
        some = [branch for branch, names in zip(params["branches"], platforms, strict=True) if names is None or here in names]
        return [Last(one) for one in taken(some[0])(*arrays)]
    return [Last(one) for one in lax.switch(index, [taken(branch) for branch in params["branches"]], *arrays)]


def _with_rule(params: dict[str, Any], operands: list, out: list, size: int) -> list:
    """A function with a derivative of its own (`jax.custom_jvp`), both with the batch last."""
    of_batch = [isinstance(one, Last) for one in operands]
    widened = lambda found: [wide(one, like.shape, size) for one, like in zip(found, out, strict=True)]

    @jax.custom_jvp
    def function(*some):
        return widened(evaluate(params["call_jaxpr"], _boxed(some, of_batch), size))

    @function.defjvp
    def _(primals, tangents):
        jaxpr, constants, zero = params["jvp_jaxpr_fun"].call_wrapped(*[False] * len(operands))
        closed = core.ClosedJaxpr(jaxpr, constants)
        found = evaluate(closed, [*_boxed(primals, of_batch), *_boxed(tangents, of_batch)], size)
        slopes = iter(found[len(out) :])
        none = lambda one: jnp.zeros(one.shape, one.dtype)
        moving = [none(one) if nothing else next(slopes) for one, nothing in zip(out, zero, strict=True)]
        return widened(found[: len(out)]), widened(moving)

    return [Last(one) for one in function(*(one.array if isinstance(one, Last) else one for one in operands))]


def _jvp(primals: Sequence[Any], tangents: Sequence[Any], **how: Any) -> tuple[list, list]:
    """Of a single scan."""
    tangents = [ad.instantiate_zeros(tangent) for tangent in tangents]
    return jax.jvp(functools.partial(_plain, **how), list(primals), tangents)


_scan = core.Primitive("jaxveh_scan_batch_last")
_scan.multiple_results = True
_scan.def_impl(_plain)
_scan.def_abstract_eval(
    lambda *avals, **how: [
        jax.core.ShapedArray(one.shape, one.dtype) for one in jax.eval_shape(functools.partial(_plain, **how), *avals)
    ]
)
mlir.register_lowering(_scan, mlir.lower_fun(_plain, multiple_results=True))
batching.primitive_batchers[_scan] = _batched
ad.primitive_jvps[_scan] = _jvp
