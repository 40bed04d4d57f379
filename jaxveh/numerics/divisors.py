"""Divisors of quotients that are not always taken."""

import jax.numpy as jnp
from jax import Array


def or_one(value: Array, here: Array) -> Array:
    """`value` where `here` holds, elsewhere 1.

    For a divisor, or the argument of a root or a logarithm, where the result elsewhere is zero or is not taken: with zero or
    less there, derivatives would be NaN.
    """
    return jnp.where(here, value, 1)
