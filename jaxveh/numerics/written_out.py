"""Functions of small arrays written out in scalars, for speed.

Under `jax.vmap` each scalar becomes an array over the batch, so that XLA's loops run along the batch; it would take a
batch of 3 by 3 matrices one by one. 1000 unscented filters of three states then take a fourteenth of the time (28
instead of 400 ns per run and step, jax 0.12, float64, log-likelihoods only).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend import core

from jaxveh.numerics import entry_rules as rules
from jaxveh.numerics.entries import Entries, array_of, entries, entry_list, is_known, scalar_of, split
from jaxveh.numerics.fences import fence

CALLS = ("pjit", "jit", "closed_call", "core_call", "remat", "remat2", "checkpoint")
"""Primitives that run an inner program once."""

FENCES = ("jaxveh_fence", "optimization_barrier")

WHOLE = "jaxveh_whole"
"""The name of functions that are wrapped by `as_whole`."""

LONG = 1500
"""The largest number of scalars for which a function `as_whole` is written out: beyond it, compiling takes longer than
it saves."""


def as_whole(function: Callable) -> Callable:
    """The function, marked so that `scan_written_out` computes it on whole arrays if it would be more than `LONG` scalars."""

    def jaxveh_whole(*operands):
        return function(*operands)

    return jax.jit(jaxveh_whole)


def scalars_of(program: Any) -> int:
    """Approximately the number of scalars of a jaxpr that is written out."""
    jaxpr = program.jaxpr if hasattr(program, "jaxpr") else program
    count = 0
    for equation in jaxpr.eqns:
        inner = [value for value in equation.params.values() if hasattr(value, "eqns") or hasattr(value, "jaxpr")]
        count += scalars_of(inner[0]) if inner else sum(math.prod(one.aval.shape) for one in equation.outvars)
    return count


PyTree = Any


def write_out(function: Callable, *operands: PyTree, complete: bool = False) -> PyTree:
    """`function(*operands)`, written out in scalars; `complete`: every number of the operands is finite."""
    closed, shapes = jax.make_jaxpr(function, return_shape=True)(*operands)
    given = [entries(leaf) for leaf in jax.tree.leaves(operands)]
    found = evaluate(closed, given, entry_list(given) if complete else ())
    leaves, structure = jax.tree.flatten(shapes)
    return jax.tree.unflatten(structure, [array_of(one, leaf.dtype) for one, leaf in zip(found, leaves, strict=True)])


def evaluate(program: Any, operands: list[Entries], finite: Sequence[Any] = ()) -> list[Entries]:
    """The results of a closed jaxpr for operands that are written out, of which some entries are known to be `finite`."""
    jaxpr = program.jaxpr if hasattr(program, "jaxpr") else program
    values: dict[Any, Entries] = {}
    read = lambda one: entries(np.asarray(one.val, one.aval.dtype)) if isinstance(one, core.Literal) else values[one]
    values.update(zip(jaxpr.constvars, (entries(constant) for constant in getattr(program, "consts", ())), strict=True))
    values.update(zip(jaxpr.invars, operands, strict=True))
    for equation in jaxpr.eqns:
        found = _results(equation, [read(one) for one in equation.invars], finite)
        values.update(zip(equation.outvars, found, strict=True))
    return [read(one) for one in jaxpr.outvars]


def _results(equation: Any, operands: list[Entries], finite: Sequence[Any]) -> list[Entries]:
    """The results of one equation."""
    name, params = equation.primitive.name, equation.params
    out = [one.aval for one in equation.outvars]
    if name == "is_finite" and all(any(entry is one for one in finite) for entry in operands[0].reshape(-1)):
        return [entries(np.ones(out[0].shape, bool))]
    if name in rules.ELEMENTWISE:
        return [rules.elementwise(equation.primitive, params, operands, out[0])]
    if name in rules.MOVES:
        found = rules.MOVES[name](params, operands, out[0])
        if found is not None:
            return found if isinstance(found, list) else [found]
    if name in (*rules.REDUCTIONS, "dot_general") and not all(one.size for one in operands):
        return _whole(equation, operands)
    if name in rules.REDUCTIONS:
        return [rules.reduction(name, tuple(params["axes"]), operands[0], out[0])]
    if name == "dot_general":
        return [rules.inner_products(params, operands, out[0])]
    if name in CALLS:
        if params.get("name") == WHOLE and scalars_of(params["jaxpr"]) > LONG:
            return _whole(equation, operands)
        return evaluate(params["jaxpr"], operands, finite)
    if name in FENCES:
        return _fenced(operands)
    if name == "cond":
        return _branches(params["branches"], operands, out, finite)
    if name == "custom_jvp_call" and _is_ruled(params, equation):
        return _with_rule(params, operands, [one.aval for one in equation.invars], out)
    return _whole(equation, operands)


def _is_ruled(params: dict[str, Any], equation: Any) -> bool:
    """Whether a function with a derivative rule can be written out: the rule is available, and all operands are
    floating point."""
    floating = all(jnp.issubdtype(one.aval.dtype, jnp.floating) for one in equation.invars)
    return floating and params.get("num_consts") == 0 and hasattr(params.get("jvp_jaxpr_fun"), "call_wrapped")


def scalars_from(found: Sequence[Entries], like: Sequence[Any]) -> list[jax.Array]:
    """The entries of results as JAX scalars, each of the dtype of its array."""
    return [scalar_of(entry, one.dtype) for those, one in zip(found, like, strict=True) for entry in those.reshape(-1)]


def _fenced(several: list[Entries]) -> list[Entries]:
    """The arrays, where all entries that are not known pass one barrier."""
    places, fill = _filled(items := entry_list(several))
    return split(fill(fence([items[i] for i in places])), [one.shape for one in several])


def _filled(items: list) -> tuple[list[int], Callable[[Any], list]]:
    """The places of the items that are not known, and a function that returns the items with other values there."""
    places = [i for i, item in enumerate(items) if not is_known(item)]

    def fill(some):
        found = list(items)
        for i, item in zip(places, some, strict=True):
            found[i] = item
        return found

    return places, fill


def _branches(branches: Any, operands: list[Entries], out: list, finite: Sequence[Any]) -> list[Entries]:
    """A conditional with one predicate, whose branches are written out."""
    index, *rest = operands
    if is_known(index[()]):
        return evaluate(branches[int(index[()])], rest, finite)
    items, shapes = entry_list(rest), [one.shape for one in rest]
    places, fill = _filled(items)

    def taken(branch):
        def run(*some):
            return scalars_from(evaluate(branch, split(fill(some), shapes), finite), out)

        return run

    found = lax.switch(index[()], [taken(branch) for branch in branches], *(items[i] for i in places))
    return split(found, [one.shape for one in out])


def _with_rule(params: dict[str, Any], operands: list[Entries], given: list, out: list) -> list[Entries]:
    """A function with a derivative rule (`jax.custom_jvp`), both written out."""
    items, shapes = entry_list(operands), [one.shape for one in operands]
    dtypes = [one.dtype for one in given for _ in range(math.prod(one.shape))]
    places, fill = _filled(items)
    call = lambda some: evaluate(params["call_jaxpr"], split(fill(some), shapes))
    if not places:
        return call([])

    @jax.custom_jvp
    def function(*some):
        return scalars_from(call(some), out)

    @function.defjvp
    def _(primals, tangents):
        jaxpr, constants, zero = params["jvp_jaxpr_fun"].call_wrapped(*[False] * len(given))
        moved: list[Any] = [np.zeros((), dtype)[()] for dtype in dtypes]
        for i, tangent in zip(places, tangents, strict=True):
            moved[i] = tangent
        closed = core.ClosedJaxpr(jaxpr, constants)
        found = evaluate(closed, split(fill(primals), shapes) + split(moved, shapes))
        values, slopes = found[: len(out)], iter(found[len(out) :])
        none = lambda one: entries(np.zeros(one.shape, one.dtype))
        moving = [none(one) if nothing else next(slopes) for one, nothing in zip(out, zero, strict=True)]
        return scalars_from(values, out), scalars_from(moving, out)

    return split(function(*(items[i] for i in places)), [one.shape for one in out])


def _whole(equation: Any, operands: list[Entries]) -> list[Entries]:
    """The results of an equation without a rule here, on whole arrays."""
    variables, arrays = [], []
    for one, those in zip(equation.invars, operands, strict=True):
        if not isinstance(one, core.Literal) and one not in variables:
            variables.append(one)
            arrays.append(array_of(those, one.aval.dtype))
    # Without fences each entry would be computed from the beginning, with everything that it depends on.
    found = fence(core.jaxpr_as_fun(alone(equation, variables))(*fence(arrays)))
    return [entries(one) for one in found]


def alone(equation: Any, variables: list) -> core.ClosedJaxpr:
    """One equation as a program of these variables, which must be all variables that it reads."""
    empty = jax.make_jaxpr(lambda: ())().jaxpr
    jaxpr = empty.replace(
        constvars=[], invars=variables, outvars=list(equation.outvars), eqns=[equation], effects=equation.effects,
        debug_info=empty.debug_info.with_unknown_names(),
    )  # fmt: skip
    return core.ClosedJaxpr(jaxpr, [])


APART = 36
"""The largest number of entries of an array that `as_entries` splits."""


def as_entries(tree: PyTree) -> PyTree:
    """The tree with small arrays replaced by tuples of their scalars, so that `scan_written_out` stacks single columns."""
    few = lambda leaf: np.ndim(leaf) > 0 and np.size(leaf) <= APART
    return jax.tree.map(lambda leaf: tuple(entries(leaf).reshape(-1)) if few(leaf) else leaf, tree)


def from_entries(tree: PyTree, like: PyTree) -> PyTree:
    """The inverse of `as_entries`: arrays in the shapes of `like`."""
    leaves, structure = jax.tree.flatten(like)
    whole = lambda found, one: jnp.stack(found).reshape(np.shape(one)) if isinstance(found, tuple) else found
    return jax.tree.unflatten(
        structure, [whole(found, one) for found, one in zip(structure.flatten_up_to(tree), leaves, strict=True)]
    )
