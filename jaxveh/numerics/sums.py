"""Sums over particles."""

import jax
import jax.numpy as jnp
from jax import Array

from jaxveh.numerics.fences import fence
from jaxveh.numerics.platform import on_cpu

_LANES = 40
"""The number of parallel sums: enough for the processor's vectors and to hide the latency of an addition."""


@jax.jit
def total(values: Array) -> Array:
    """The sum of (N,) numbers, in an order that depends only on N.

    XLA on the CPU adds the numbers of an array one after the other, each addition waiting for the last; `_LANES` parallel sums
    take a third of the time (11 means and standard deviations of 1000 particles: 2.7 instead of 9.3 ns per particle).
    """
    size = values.shape[-1]
    count = size // _LANES
    if count < 2 or not on_cpu():
        return jnp.sum(values)
    # The fence prevents XLA from merging the two sums into one.
    lanes = fence(jnp.sum(values[: count * _LANES].reshape(count, _LANES), axis=0))
    rest = values[count * _LANES :]
    return jnp.sum(lanes) + jnp.sum(rest) if rest.size else jnp.sum(lanes)
