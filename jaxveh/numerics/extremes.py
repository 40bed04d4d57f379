"""Largest and smallest of several values, with a derivative that is always finite."""

import jax.numpy as jnp
from jax import Array


def largest(values: Array) -> Array:
    """The largest of all `values`, NaN if one is NaN; its derivative is that of the first of them.

    That of `jnp.max` divides by the number of values that equal the largest. XLA may compute the values once for the largest and
    once for this comparison, with roundings that differ: then there is none, and the derivative is NaN.
    """
    every = jnp.ravel(values)
    return every[jnp.argmax(every)]


def smallest(values: Array) -> Array:
    """The smallest of all `values`, as `largest`."""
    return -largest(-values)
