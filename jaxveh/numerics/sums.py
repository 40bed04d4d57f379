"""Sums over particles."""

import jax
import jax.numpy as jnp
from jax import Array

from jaxveh.numerics.fences import fence
from jaxveh.numerics.platform import on_cpu

_LANES = 40
"""Sums side by side: enough for the processor's vectors and to hide an addition's latency."""


@jax.jit
def total(values: Array) -> Array:
    """The sum of (N,) numbers, in an order that depends on N alone.

    XLA on the CPU adds the numbers of an array one after the other, each waiting for the last; `_LANES` sums side by side
    take a third of the time (11 means and spreads of 1000 particles: 2.7 instead of 9.3 ns a particle).
    """
    size = values.shape[-1]
    count = size // _LANES
    if count < 2 or not on_cpu():
        return jnp.sum(values)
    # The fence keeps XLA from making one sum of the two again.
    lanes = fence(jnp.sum(values[: count * _LANES].reshape(count, _LANES), axis=0))
    rest = values[count * _LANES :]
    return jnp.sum(lanes) + jnp.sum(rest) if rest.size else jnp.sum(lanes)
