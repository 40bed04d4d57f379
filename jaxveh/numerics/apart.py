"""A program of its own inside another."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp


@eqx.filter_jit
def apart(function, condition, *operands):
    """`function(*operands)` as a program of its own, so that a step's bits do not depend on what surrounds it.

    XLA fuses a step with its surroundings, differently in a scan, in a live loop and beside other outputs, and rounds
    differently with it. It never fuses across a conditional: `condition` holds for every input, and XLA must not be able
    to know that. Called outside jit, this is compiled once as well. Transformations pass through; under differentiation
    there is no conditional, which would cost a copy of all that the backward pass needs.
    """
    arrays, rest = eqx.partition((function, operands), eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)

    def together(*leaves):
        function, operands = eqx.combine(jax.tree.unflatten(structure, leaves), rest)
        return function(*operands)

    @jax.custom_jvp
    def alone(condition, *leaves):
        never = lambda *_: jax.tree.map(_zeros, jax.eval_shape(together, *leaves))
        return jax.lax.cond(condition, together, never, *leaves)

    @alone.defjvp
    def _(primals, tangents):
        condition, *leaves = primals
        # In a batch the condition makes every result a batch. The selection does so here, where jax counts on the same.
        selected = lambda *leaves: jax.tree.map(lambda x: jnp.where(condition, x, _zeros(x)), together(*leaves))
        return jax.jvp(selected, tuple(leaves), tuple(tangents[1:]))

    return alone(condition, *leaves)


def always(t):
    """True for every time, NaN included, as a condition on its bits: all but one of the NaNs that arithmetic never makes."""
    unsigned, odd = (jnp.uint32, 0x7FA55A5A) if t.dtype == jnp.float32 else (jnp.uint64, 0x7FF55A5A5A5A5A5A)
    return jax.lax.bitcast_convert_type(t, unsigned) != jnp.asarray(odd, unsigned)


def _zeros(like):
    if jnp.issubdtype(like.dtype, jax.dtypes.prng_key):
        # The only generator that `numerics` draws from.
        return jax.random.wrap_key_data(jnp.zeros((*like.shape, 2), jnp.uint32), impl="threefry2x32")
    return jnp.zeros(like.shape, like.dtype)
