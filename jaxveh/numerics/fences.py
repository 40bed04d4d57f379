"""Fences make XLA on the CPU compute a value once and store it, instead of computing it again for each of its uses.

One rule: a value that is used several times and costs more to compute than to store is fenced at the end of the
function that computes it, by a decorator (`fence_results`) or in its last statement. Formulas of tyres and vehicles
stay as in the book; each exception has a measured number as its reason (`tests/core/test_where_fences_stand.py`).

- `fence(tree)`: an optimization barrier. XLA respects it from jax 0.12 on; before that, only speed is lost.
- `fence(tree, firm=True)`: a fence in every version of jax.
- `@fence_results`, `fence_blocks(tree)`: firm, for arrays that are short enough for the processor's cache and long
  enough to justify a branch.
- `apart(function, ...)`: a whole function as a separate program, whose *bits* do not depend on its surroundings.

All are the identity for values, batches and derivatives. On platforms other than the CPU the first three do nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from jaxveh._core.errors import is_concrete
from jaxveh.numerics.platform import barriers_hold, on_cpu

Tree = TypeVar("Tree")
Method = TypeVar("Method", bound=Callable)

MANY = 32
"""From this size on, computing numbers twice costs more than a branch around them: 60 vmapped cars gain, 12 hardly.
Arrays of every size are fenced where XLA respects barriers, which cost nothing, and under differentiation: there a formula
has several times as many operations, and without a fence XLA copies them into whatever uses them. On jax 0.10 the Jacobians
of one 14-DOF car compile in 26 instead of 70 s with it, and each takes 184 instead of 238 us; a filter of a 7-DOF car takes
the same time within 4 %."""

CACHED = 2**15
"""The size (bytes) of an array of which a few dozen fit into a processor's own cache."""

UNUSED_NAN = {"float32": (np.uint32, 0x7FDA_57ED), "float64": (np.uint64, 0x7FFA_57ED_57ED_57ED)}
"""The bits of NaNs that no calculation gives."""


def fence(tree: Tree, *, firm: bool = False) -> Tree:
    """`tree`, which XLA on the CPU computes once and stores; if not `firm`, only from jax 0.12 on.

    `firm`: for rates with hundreds of operations, where computing them twice costs more than the branch that replaces
    the barrier before jax 0.12: there, 1000 7-DOF cars take 175 instead of 400 ns per step with it, and one car takes
    7.3 instead of 9.6 us.
    """
    return _of_traced(tree, _firmly(worth=False) if firm else _barrier)


def fence_blocks(tree: Tree) -> Tree:
    """`tree`, with firm fences for arrays that are short enough for the cache, and before jax 0.12 have at least 32 numbers
    or are differentiated.

    For values that are used several times in an elementwise formula of many terms: blocks of a batch and their
    cotangents are computed once, whereas a whole batch, which would have to go to memory and back, is still fused.
    """
    return _of_traced(tree, _firmly(worth=True))


def fence_results(method: Method) -> Method:
    """A decorator of a function or method: its result passes through `fence_blocks`."""

    @functools.wraps(method)
    def fenced_method(*arguments, **named):
        return fence_blocks(method(*arguments, **named))

    return fenced_method  # pyright: ignore[reportReturnType]


def _of_traced(tree: Tree, through: Callable) -> Tree:
    """The tree, on the CPU with its traced leaves passed `through`. A plain number is unchanged, so that checks on the
    host can read it."""
    leaves, structure = jax.tree.flatten(tree)
    traced = [i for i, leaf in enumerate(leaves) if not is_concrete(leaf)]
    if traced and on_cpu():
        for i, leaf in zip(traced, through([leaves[i] for i in traced]), strict=True):
            leaves[i] = leaf
    return jax.tree.unflatten(structure, leaves)


def _firmly(worth: bool) -> Callable:
    return lambda leaves: _firm.bind(*leaves, worth=worth, least=MANY, barrier=barriers_hold())


def _barrier(leaves: list) -> list:
    return _firm.bind(*leaves, worth=False, least=1, barrier=True)


# This is a primitive for three reasons. The transpose of `lax.optimization_barrier` in jax 0.11 and 0.12 fails if an operand
# is not differentiated, as zeros that a `custom_jvp` has made arrays are not. Whether a fence pays depends on the size, which
# under `vmap` is known only with the batch. And an ordinary `lax.cond` would become a selection there, which does not fence. A
# step of 240 vmapped 7-DOF cars on MF-Tyre takes 2.8 instead of 17 us per car on jax 0.10, and 1.9 instead of 2.4 on jax 0.12.


def _lowered(*leaves, worth, least, barrier):
    found = list(leaves)
    some = [
        i for i, leaf in enumerate(found) if leaf.size and (not worth or _worth_storing(leaf, 1 if barrier else least))
    ]
    if some:
        through = lax.optimization_barrier if barrier else _through_branch
        for i, leaf in zip(some, through([found[i] for i in some]), strict=True):
            found[i] = leaf
    return found


def _worth_storing(leaf, least: int) -> bool:
    size = np.size(leaf)
    return size >= least and size * leaf.dtype.itemsize <= CACHED


def _through_branch(leaves: list) -> list:
    """The arrays passed through a branch that is always taken, which XLA cannot know: it fuses nothing across the branch.

    On jax 0.10 the gradient of MF-Tyre in blocks takes 610 instead of 1130 ns per contact, and 9 instead of 15 s to
    compile; an array that passes through costs 0.4 ns per number. Arrays of several dtypes, or of other dtypes than
    float32 and float64, are returned unchanged.
    """
    kinds = {str(leaf.dtype) for leaf in leaves}
    if len(kinds) > 1 or not kinds <= set(UNUSED_NAN):
        return leaves
    keep, never = (lambda leaves: leaves), (lambda leaves: [jnp.full_like(leaf, jnp.nan) for leaf in leaves])
    return lax.cond(_always(leaves[0].reshape(-1)[0]), keep, never, leaves)


def _always(number):
    """True for every number that a calculation gives, including NaN; XLA cannot know that it is true."""
    if not jnp.issubdtype(number.dtype, jnp.floating):
        return number != jnp.asarray(jnp.iinfo(number.dtype).min, number.dtype)
    kind, unused = UNUSED_NAN[str(number.dtype)]
    return lax.bitcast_convert_type(number, kind) != kind(unused)


def _differentiated(primals, tangents, **how):
    how |= {"least": 1}
    return _firm.bind(*primals, **how), _of_those_there(tangents, **how)


def _transposed(cotangents, *operands, **how):
    """Cotangents of the operands in which the fence is linear; None for the others, which are known."""
    linear = [ad.is_undefined_primal(operand) for operand in operands]
    found = iter(_of_those_there([c for c, there in zip(cotangents, linear, strict=True) if there], **how))
    return [next(found) if there else None for there in linear]


def _of_those_there(values, **how):
    """Tangents or cotangents, with fences for those that are not symbolic zeros."""
    values = list(values)
    there = [i for i, value in enumerate(values) if not isinstance(value, ad.Zero)]
    if there:
        for i, value in zip(there, _firm.bind(*(values[i] for i in there), **how), strict=True):
            values[i] = value
    return values


_firm = Primitive("jaxveh_fence")
_firm.multiple_results = True
_firm.def_impl(lambda *leaves, **how: list(leaves))
_firm.def_abstract_eval(lambda *avals, **how: list(avals))
mlir.register_lowering(_firm, mlir.lower_fun(_lowered, multiple_results=True))
batching.primitive_batchers[_firm] = lambda leaves, axes, **how: (_firm.bind(*leaves, **how), axes)
ad.primitive_jvps[_firm] = _differentiated
ad.primitive_transposes[_firm] = _transposed


@eqx.filter_jit
def apart(function, number, *operands):
    """`function(*operands)` as a separate program, so that a step's bits do not depend on its surroundings.

    XLA fuses a step with its surroundings, differently in a scan, in a live loop and beside other outputs, which
    changes the rounding. It never fuses across a conditional; `number`, any number given to the step (its time, its
    count), makes a conditional that is always true. A call outside jit is also compiled once. Transformations pass
    through; under differentiation there is no conditional, as it would cost a copy of all values that the backward pass needs.
    """
    arrays, rest = eqx.partition((function, operands), eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)

    # Traced once, and inlined wherever it is called, four times below.
    @functools.partial(jax.jit, inline=True)
    def together(*leaves):
        function, operands = eqx.combine(jax.tree.unflatten(structure, leaves), rest)
        return function(*operands)

    @jax.custom_jvp
    def alone(condition, *leaves):
        never = lambda *_: jax.tree.map(_zeros, jax.eval_shape(together, *leaves))
        return lax.cond(condition, together, never, *leaves)

    @alone.defjvp
    def _(primals, tangents):
        condition, *leaves = primals
        # In a batch the condition makes every result batched. The selection has the same effect here, as jax expects.
        selected = lambda *leaves: jax.tree.map(lambda x: jnp.where(condition, x, _zeros(x)), together(*leaves))
        return jax.jvp(selected, tuple(leaves), tuple(tangents[1:]))

    return alone(_always(number), *leaves)


def _zeros(like):
    if jnp.issubdtype(like.dtype, jax.dtypes.prng_key):
        # The only generator from which `numerics` draws.
        return jax.random.wrap_key_data(jnp.zeros((*like.shape, 2), jnp.uint32), impl="threefry2x32")
    return jnp.zeros(like.shape, like.dtype)
