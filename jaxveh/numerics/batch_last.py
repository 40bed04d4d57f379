"""Evaluates a program for a batch whose axis is the last axis of every array, so that XLA's loops run along the batch.

Under `jax.vmap` the batch is the first axis, and XLA on the CPU takes its small matrices one by one: sums over 11
numbers are short loops, and each Cholesky factor is a call of LAPACK. The scalars of `written_out`, which serve for few
states, would take too long to compile for more. A batch of unscented filters of 11 states takes a sixth of the time
(1.5 instead of 9.5 us per run and step, jax 0.12, float64).

Each sum that is written out is followed by a barrier: otherwise XLA would compute its terms once for each use of the
sum, which it does not do with its own reductions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend import core

from jaxveh.numerics import entry_rules, last_axis
from jaxveh.numerics.fences import fence
from jaxveh.numerics.last_axis import Last, Product, wide
from jaxveh.numerics.platform import on_cpu
from jaxveh.numerics.written_out import CALLS, FENCES, alone


def as_last(arrays: Sequence[Any], of_batch: Sequence[bool]) -> list:
    """The arrays, where those that are `of_batch` are wrapped as `Last`."""
    return [Last(one) if last else one for one, last in zip(arrays, of_batch, strict=True)]


def evaluate(program: Any, operands: Sequence[Any], size: int) -> list:
    """The results of a closed jaxpr; each operand is `Last`, or one value for the whole batch."""
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


def results_of_batch(program: Any, of_batch: Sequence[bool]) -> list[bool]:
    """Which results of a program are of the batch, if these operands are."""
    jaxpr = getattr(program, "jaxpr", program)
    found = dict.fromkeys(jaxpr.constvars, False) | dict(zip(jaxpr.invars, of_batch, strict=True))
    read = lambda one: not isinstance(one, core.Literal) and found[one]
    for equation in jaxpr.eqns:
        name, given = equation.primitive.name, [read(one) for one in equation.invars]
        if name in CALLS or name == "custom_jvp_call":
            results = results_of_batch(equation.params["call_jaxpr" if name == "custom_jvp_call" else "jaxpr"], given)
        elif name == "cond" and not given[0]:
            results = _any_branch_of_batch(equation.params["branches"], given[1:])
        elif name in FENCES:
            results = given
        else:
            results = [any(given)] * len(equation.outvars)
        found.update(zip(equation.outvars, results, strict=True))
    return [read(one) for one in jaxpr.outvars]


def _any_branch_of_batch(branches: Sequence[Any], given: Sequence[bool]) -> list[bool]:
    return [any(several) for several in zip(*(results_of_batch(one, given) for one in branches), strict=True)]


def _only_summed(jaxpr: Any) -> set:
    """The variables that are read by one sum and by nothing else."""
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
        return as_last(equation.primitive.bind(*arrays, **params), [isinstance(one, Last) for one in operands])
    if name == "cond" and not isinstance(operands[0], Last):
        return _branches(params, operands, out, size)
    if name == "custom_jvp_call":
        return evaluate(params["call_jaxpr"], operands, size)
    if name == "gather" and not isinstance(operands[1], Last):
        return [Last(last_axis.gather(params, operands[0].array, operands[1], out[0].shape))]
    if name == "pad" and not isinstance(operands[1], Last):
        config = (*params["padding_config"], (0, 0, 0))
        return [Last(lax.pad(operands[0].array, jnp.asarray(operands[1]), config))]
    rule = last_axis.MOVES.get(name) or last_axis.ALGEBRA.get(name)
    if rule is not None:
        arrays = [wide(one, var.aval.shape, size) for one, var in zip(operands, equation.invars, strict=True)]
        found = rule(params, arrays, out)
        if found is not None:
            return [Last(one) for one in (found if isinstance(found, list) else [found])]
    return _by_vmap(equation, operands)


def _reduced(equation: Any, operand: Any) -> Any:
    """A reduction, written out if it has few terms."""
    axes = tuple(equation.params["axes"])
    array = operand if isinstance(operand, Product) else operand.array
    if not axes:
        return array
    found = last_axis.reduction(entry_rules.REDUCTIONS[equation.primitive.name][1], axes, array)
    if found is not None:
        return found
    if isinstance(array, Product):
        array = array.factors[0] * array.factors[1]
    return equation.primitive.bind(array, **equation.params)


def _variables(equation: Any, operands: list) -> dict[Any, Any]:
    """The values of an equation's variables, each once."""
    return {
        one: value for one, value in zip(equation.invars, operands, strict=True) if not isinstance(one, core.Literal)
    }


def _for_all(equation: Any, operands: list) -> list:
    """The results of an equation whose operands are the same for the whole batch."""
    values = _variables(equation, operands)
    return core.jaxpr_as_fun(alone(equation, list(values)))(*values.values())


def _by_vmap(equation: Any, operands: list) -> list:
    """The results of an equation without a rule here, by `jax.vmap`."""
    values = _variables(equation, operands)
    axes = [-1 if isinstance(one, Last) else None for one in values.values()]
    arrays = [one.array if isinstance(one, Last) else one for one in values.values()]
    # Without fences each number would be computed from the beginning, with everything that it depends on.
    found = jax.vmap(core.jaxpr_as_fun(alone(equation, list(values))), axes, -1)(*fence(arrays))
    return [Last(one) for one in fence(found)]


def _branches(params: dict[str, Any], operands: list, out: list, size: int) -> list:
    """A conditional with one predicate for the whole batch."""
    index, *rest = operands
    of_batch = [isinstance(one, Last) for one in rest]
    arrays = [one.array if last else one for one, last in zip(rest, of_batch, strict=True)]

    branches, platforms = params["branches"], params.get("branches_platforms")
    results = _any_branch_of_batch(branches, of_batch)

    def taken(branch):
        def run(*some):
            found = evaluate(branch, as_last(some, of_batch), size)
            return [
                wide(one, like.shape, size) if last else jnp.asarray(one, like.dtype)
                for one, like, last in zip(found, out, results, strict=True)
            ]

        return run

    if platforms is not None:  # a choice by platform, which is known here
        here = "cpu" if on_cpu() else jax.default_backend()
        chosen = next(i for i, names in enumerate(platforms) if names is None or here in names)
        return as_last(taken(branches[chosen])(*arrays), results)
    return as_last(lax.switch(index, [taken(branch) for branch in branches], *arrays), results)
