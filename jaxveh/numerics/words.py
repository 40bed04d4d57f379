"""Random angles from random words."""

import math

import jax
import jax.numpy as jnp
from jax import Array, lax

from jaxveh.numerics import polynomials
from jaxveh.numerics.float_bits import bits_of, flip_sign


def sin_cos_of_word(word: Array, dtype: jax.typing.DTypeLike) -> tuple[Array, Array]:
    """Sine and cosine of an angle that is uniform over the circle, from random words: uint32, or uint64 for float64.

    Two bits choose the signs, one bit whether sine and cosine are swapped, and the others an angle in
    (-pi / 4, pi / 4), so that neither a reduction nor a long polynomial is needed.
    """
    bits = 8 * word.dtype.itemsize
    signed = jnp.int32 if bits == 32 else jnp.int64
    # The low three bits select, and are set to 7 in the angle: after 3 is subtracted, it is symmetric about 0 and never 0.
    integer = lax.bitcast_convert_type(word | bits_of(word, 7), signed)
    unit = 2.0 ** (1 - bits)
    # The subtraction between the two factors also prevents XLA from merging them: powers of so small a constant underflow.
    r = (integer.astype(dtype) * unit - 3 * unit) * (math.pi / 4)
    t = r * r
    sine = r + r * t * polynomials.evaluate(
        polynomials.of_dtype(r, polynomials.OCTANT_SINE_32, polynomials.OCTANT_SINE_64), t
    )
    cosine = 1.0 + t * polynomials.evaluate(
        polynomials.of_dtype(r, polynomials.OCTANT_COSINE_32, polynomials.OCTANT_COSINE_64), t
    )
    swap = (word & bits_of(word, 1)) != bits_of(word, 0)
    first, second = jnp.where(swap, cosine, sine), jnp.where(swap, sine, cosine)
    return flip_sign(first, word >> bits_of(word, 1)), flip_sign(second, word >> bits_of(word, 2))


def half_turn_of_word(word: Array, dtype: jax.typing.DTypeLike) -> tuple[Array, Array]:
    """Sine and cosine of an angle that is uniform over the circle, from random words uint32.

    The lowest bit chooses the half turn, the others an angle in (-pi / 2, pi / 2): each function is one polynomial, so
    that computing them separately repeats no work. Absolute errors are those of `sin`; where the relative error of a
    cosine near 0 matters, use `sin_cos_of_word`.
    """
    # The addition sets the lowest bit, so that the integers are symmetric about 0. It also prevents XLA from merging
    # the two factors: powers of so small a constant underflow.
    integer = lax.bitcast_convert_type(word & bits_of(word, 2**32 - 2), jnp.int32)
    r = (integer.astype(dtype) * 2.0**-32 + 2.0**-32) * math.pi
    t = r * r
    sine = r + r * t * polynomials.evaluate(polynomials.of_dtype(r, polynomials.SINE_32, polynomials.SINE_64), t)
    cosine = 1.0 + t * polynomials.evaluate(polynomials.of_dtype(r, polynomials.COSINE_32, polynomials.COSINE_64), t)
    return sine, flip_sign(cosine, word)
