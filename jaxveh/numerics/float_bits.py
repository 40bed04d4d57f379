"""Floating point numbers as their bits."""

import jax.numpy as jnp
from jax import Array, lax


def float_layout(x: Array) -> tuple[type, int]:
    """The unsigned type of a number's bits, and the number of bits of the mantissa."""
    return (jnp.uint32, 23) if x.dtype == jnp.float32 else (jnp.uint64, 52)


def bits_of(word: Array, value: int) -> Array:
    """The whole number `value` as a word of the type of `word`."""
    return jnp.asarray(value, word.dtype)


def flip_sign(x: Array, word: Array) -> Array:
    """`x` with its sign flipped where the lowest bit of `word` is set."""
    unsigned, _ = float_layout(x)
    sign = word.astype(unsigned) << jnp.asarray(8 * x.dtype.itemsize - 1, unsigned)
    return lax.bitcast_convert_type(lax.bitcast_convert_type(x, unsigned) ^ sign, x.dtype)


def sign_of(x: Array) -> Array:
    """1 with the sign bit of `x`; by bits, because a comparison loses the sign of zero. Its derivative is zero."""
    unsigned, _ = float_layout(x)
    mask = jnp.asarray(1 << (8 * x.dtype.itemsize - 1), unsigned)
    one = lax.bitcast_convert_type(jnp.ones_like(x), unsigned)
    return lax.bitcast_convert_type(one | (lax.bitcast_convert_type(x, unsigned) & mask), x.dtype)
