"""Places the fences of a program by the uses of its values.

XLA on the CPU makes loops with one result each: a value that two of them need is computed in both, with everything that
it depends on, unless it is fenced. In a step of a filter, and above all in its derivative, this doubles the work: with
fences by use 250 unscented filters of three states take 15 instead of 22 us per step, and their values with the gradient
70 instead of 153 (jax 0.12, float64, AMD EPYC).

A value of an elementwise program is fenced if computing it in all loops that need it costs more than a loop of its own, or
if its loop has become long. Equal values are computed once.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from typing import Any

import jax
from jax.extend import core

from jaxveh.numerics.entry_rules import ELEMENTWISE
from jaxveh.numerics.fences import fence
from jaxveh.numerics.written_out import CALLS, FENCES, alone

OWN_LOOP = 16
"""What a loop of its own costs, its store and its loads included, in additions of arrays of its length. From 8 to 16,
filters and gradients take the same time and a sixth less to compile."""

LONGEST = 80
"""The longest loop, in additions: with 120, 64 filters take 5.7 instead of 4.8 us per step, and 250 17.9 instead of 14.4."""

DEAR = {
    "div": 15, "rem": 30, "sqrt": 20, "rsqrt": 20, "cbrt": 40, "exp": 30, "exp2": 30, "expm1": 40, "log": 40, "log1p": 40,
    "logistic": 40, "sin": 30, "cos": 30, "tan": 40, "sinh": 40, "cosh": 40, "tanh": 40, "asin": 40, "acos": 40, "atan": 40,
    "atan2": 40, "pow": 60, "erf": 40, "erfc": 40, "erf_inv": 60, "lgamma": 80,
}  # fmt: skip
"""What an operation costs, in additions, if more than one."""

FREE = frozenset(("broadcast_in_dim", "convert_element_type", "copy", "name", "reshape", "squeeze", "stop_gradient"))
"""Primitives that cost nothing and join any loop."""

EITHER_WAY = frozenset(("add", "add_any", "mul", "max", "min", "and", "or", "eq", "ne"))
"""Primitives of two operands whose order does not matter."""

TURNS = 4
"""Which loops need a value depends on the fences after it, what it costs on those before it: both are found in turns."""


def fence_by_use(program: core.ClosedJaxpr) -> core.ClosedJaxpr:
    """The program with its calls written out, equal values computed once, and its own fences replaced by those that pay."""
    flat = jax.make_jaxpr(lambda *operands: _called(program.jaxpr, program.consts, operands))(*program.in_avals)
    jaxpr, same = flat.jaxpr, _equal_values(flat.jaxpr)
    value = lambda one: same.get(one, one)
    needed = _needed(jaxpr, value)
    fenced = _fenced(needed, [value(one) for one in _variables(jaxpr.outvars)], value)

    def run(*operands):
        found = dict(zip(jaxpr.constvars, flat.consts, strict=True)) | dict(zip(jaxpr.invars, operands, strict=True))
        read = lambda one: one.val if isinstance(one, core.Literal) else found[value(one)]
        for equation in needed:
            for one, result in zip(equation.outvars, _bound(equation, [read(v) for v in equation.invars]), strict=True):
                found[one] = fence(result) if one in fenced else result
        return [read(one) for one in jaxpr.outvars]

    return jax.make_jaxpr(run)(*program.in_avals)


def _bound(equation: Any, operands: list) -> Sequence[Any]:
    """The results of one equation."""
    if _elementwise(equation):
        return [equation.primitive.bind(*operands, **equation.params)]
    values = {
        one: value for one, value in zip(equation.invars, operands, strict=True) if not isinstance(one, core.Literal)
    }
    return core.jaxpr_as_fun(alone(equation, list(values)))(*values.values())


def _called(jaxpr: Any, constants: Sequence[Any], operands: Sequence[Any]) -> list:
    """The results, with inner programs written out and without fences."""
    found = dict(zip(jaxpr.constvars, constants, strict=True)) | dict(zip(jaxpr.invars, operands, strict=True))
    read = lambda one: one.val if isinstance(one, core.Literal) else found[one]
    for equation in jaxpr.eqns:
        given = [read(one) for one in equation.invars]
        if equation.primitive.name in CALLS:
            inner = equation.params["jaxpr"]
            results = _called(getattr(inner, "jaxpr", inner), getattr(inner, "consts", ()), given)
        else:
            results = given if equation.primitive.name in FENCES else _bound(equation, given)
        found.update(zip(equation.outvars, results, strict=True))
    return [read(one) for one in jaxpr.outvars]


def _variables(several: Sequence[Any]) -> list:
    """The variables among operands or results, each once."""
    return list(dict.fromkeys(one for one in several if not isinstance(one, core.Literal)))


def _elementwise(equation: Any) -> bool:
    return equation.primitive.name in ELEMENTWISE or equation.primitive.name in FREE


def _equal_values(jaxpr: Any) -> dict:
    """For each variable that has the value of one before it, that variable."""
    same: dict[Any, Any] = {}
    first: dict[Any, Any] = {}
    numbers: dict[Any, int] = {}
    number = lambda one: str(numbers.setdefault(same.get(one, one), len(numbers)))
    name = lambda one: f"{one.val} {one.aval}" if isinstance(one, core.Literal) else number(one)
    for equation in jaxpr.eqns:
        if not _elementwise(equation):
            continue
        kind, operands = equation.primitive.name, [name(one) for one in equation.invars]
        if kind in EITHER_WAY:
            operands.sort()
        what = "add" if kind == "add_any" else kind, *operands, str(equation.params)
        (one,) = equation.outvars
        if what in first:
            same[one] = first[what]
        else:
            first[what] = one
    return same


def _needed(jaxpr: Any, value: Any) -> list:
    """The equations whose results are needed and not known from equal ones before."""
    wanted = {value(one) for one in _variables(jaxpr.outvars)}
    found = []
    for equation in reversed(jaxpr.eqns):
        if equation.effects or any(value(one) is one and one in wanted for one in equation.outvars):
            found.append(equation)
            wanted |= {value(one) for one in _variables(equation.invars)}
    return found[::-1]


def _fenced(equations: Sequence[Any], results: Sequence[Any], value: Any) -> set:
    """The variables to be fenced."""
    reads = [[value(one) for one in _variables(equation.invars)] for equation in equations]
    fenced: set[Any] = set()
    turn = 0
    while True:
        costs, long = _costs(equations, reads, fenced)
        # From some turn on fences only come, so that there is an end.
        before, fenced = fenced, fenced.union(long) if turn >= TURNS else set(long)
        fenced |= _needed_twice(equations, reads, results, costs, fenced)
        if fenced == before:
            return fenced
        turn += 1


def _needed_twice(
    equations: Sequence[Any], reads: list[list], results: Sequence[Any], costs: list[int], fenced: set
) -> set:
    """The variables that would be computed in several loops, at more than what a loop of their own costs."""
    readers = collections.defaultdict(list)
    for i, several in enumerate(reads):
        for one in several:
            readers[one].append(i)
    found = set()
    loops: list[set] = [set() for _ in equations]
    for i in reversed(range(len(equations))):
        one = equations[i].outvars[0]
        for k in readers[one]:
            loops[i] |= loops[k] if _elementwise(equations[k]) else {k}
        stored = one in results or one in fenced
        again = len(loops[i]) - (not stored)
        if equations[i].primitive.name in ELEMENTWISE and again * costs[i] > (0 if stored else OWN_LOOP):
            found.add(one)
        if stored or one in found:
            loops[i] = {i}
    return found


def _costs(equations: Sequence[Any], reads: Sequence[list], fenced: set) -> tuple[list[int], list]:
    """What it costs to compute each equation's results from what is stored, and the variables at which loops become too long."""
    costs, long = [], []
    behind: dict[Any, dict[int, int]] = {}
    for i, equation in enumerate(equations):
        inside: dict[int, int] = {}
        one = equation.outvars[0]
        if _elementwise(equation):
            for read in reads[i]:
                inside |= behind.get(read, {})
            inside[i] = _cost(equation)
        costs.append(sum(inside.values()))
        if costs[-1] > LONGEST and equation.primitive.name in ELEMENTWISE:
            long.append(one)
        elif one not in fenced:
            behind[one] = inside
    return costs, long


def _cost(equation: Any) -> int:
    name = equation.primitive.name
    if name == "integer_pow":
        return DEAR["div"] if equation.params["y"] < 0 else 2
    return 0 if name in FREE else DEAR.get(name, 1)
