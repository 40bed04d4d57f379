"""Arrays that XLA on the CPU computes once, however a computation is batched."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

MANY = 32
"""From this size on computing numbers twice costs more than storing them: 60 vmapped cars gain, 12 hardly."""

CACHED = 2**15
"""Bytes of an array of which a few dozen fit into a processor's own cache."""

UNUSED_NAN = {"float32": (np.uint32, 0x7FDA_57ED), "float64": (np.uint64, 0x7FFA_57ED_57ED_57ED)}
"""Words of numbers that no calculation gives."""


def held(leaves: list, *, worth: bool, barrier: bool) -> list:
    """The same arrays, of which XLA computes each once: all, or those that are `worth` it; by a `barrier`, or by a branch.

    A primitive of its own, for two reasons. What is worth it depends on the size, which under `vmap` is known only when the
    batch is; and the branch of an ordinary `lax.cond` would become a selection there, which holds nothing. A step of 240 vmapped
    7-DOF cars on MF-Tyre takes 2.8 instead of 17 us a car on jax 0.10, and 1.9 instead of 2.4 on jax 0.12.
    """
    return _held.bind(*leaves, worth=worth, barrier=barrier)


def _lowered(*leaves, worth, barrier):
    found = list(leaves)
    some = [i for i, leaf in enumerate(found) if not worth or _worth_storing(leaf)]
    if some:
        hold = lax.optimization_barrier if barrier else _by_branch
        for i, leaf in zip(some, hold([found[i] for i in some]), strict=True):
            found[i] = leaf
    return found


def _worth_storing(leaf) -> bool:
    size = np.size(leaf)
    return size >= MANY and size * leaf.dtype.itemsize <= CACHED


def _by_branch(leaves: list) -> list:
    """Through a branch that is always taken but cannot be known to be: XLA fuses nothing across it.

    On jax 0.10 the gradient of MF-Tyre in blocks takes 610 instead of 1130 ns a contact, and 9 instead of 15 s to compile; an
    array that passes through costs 0.4 ns a number. Arrays of several dtypes, or of other ones than float32 and float64, are
    as they are.
    """
    kinds = {str(leaf.dtype) for leaf in leaves}
    if len(kinds) > 1 or not kinds <= set(UNUSED_NAN):
        return leaves
    kind, unused = UNUSED_NAN[kinds.pop()]
    first = lax.bitcast_convert_type(leaves[0].reshape(-1)[0], kind)
    keep, never = (lambda leaves: leaves), (lambda leaves: [jnp.full_like(leaf, jnp.nan) for leaf in leaves])
    return lax.cond(first != kind(unused), keep, never, leaves)


def _of_those_there(values, **how):
    """Held, of tangents or cotangents, those that are no symbolic zeros."""
    values = list(values)
    there = [i for i, value in enumerate(values) if not isinstance(value, ad.Zero)]
    if there:
        for i, value in zip(there, _held.bind(*(values[i] for i in there), **how), strict=True):
            values[i] = value
    return values


_held = Primitive("jaxveh_held")
_held.multiple_results = True
_held.def_impl(lambda *leaves, **how: list(leaves))
_held.def_abstract_eval(lambda *avals, **how: list(avals))
mlir.register_lowering(_held, mlir.lower_fun(_lowered, multiple_results=True))
batching.primitive_batchers[_held] = lambda leaves, axes, **how: (_held.bind(*leaves, **how), axes)
ad.primitive_jvps[_held] = lambda primals, tangents, **how: (
    _held.bind(*primals, **how),
    _of_those_there(tangents, **how),
)
ad.primitive_transposes[_held] = lambda cotangents, *primals, **how: _of_those_there(cotangents, **how)
