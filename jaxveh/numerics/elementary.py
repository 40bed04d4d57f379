"""Elementary functions that are fast on the CPU and have finite derivatives where physics needs them.

On the CPU, float32 and float64 arrays go through polynomials of our own (`polynomials`), several times faster than
the library's; elsewhere, and for other types and weakly typed values (Python numbers), the library's functions are
used. Arrays of any shape; arguments of two-argument functions broadcast. NaN gives NaN. Errors stated are for
float32 / float64.

Every function can be differentiated to any order as it is computed: values from bits (signs, exponents) are constant
factors of differentiable values. The functions made of polynomials also have a derivative rule, which is faster and
more accurate. jax before 0.12 drops such rules from the values that the backward pass of a scan keeps, so that second
derivatives there are those of the polynomials.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jaxveh.numerics import polynomials
from jaxveh.numerics.fences import Tree, fence
from jaxveh.numerics.float_bits import float_layout, sign_of
from jaxveh.numerics.platform import on_cpu

_TANGENT_OF_PI_8 = math.sqrt(2) - 1
_TANGENT_OF_3_PI_8 = math.sqrt(2) + 1

_MANY = 64
"""From this size on, computing a number twice takes longer than storing it."""

# Multiples of these parts are exact up to 2^13 (float32) and 2^26 (float64) half turns: Cody and Waite's reduction.
_PI_PARTS_32 = (3.140625, 0.0009670257568359375, 6.278329573009626e-07)
_PI_PARTS_64 = (3.1415926218032837, 3.1786509424591713e-08, 1.2246467991473532e-16)


@jax.jit
def sin(x: ArrayLike) -> Array:
    """Sine of an angle in rad, any shape.

    Absolute error below 2e-7 / 1e-15 for |x| <= 2e4 / 1e8 rad, relative to the result near 0. For larger |x| the error grows as
    if the angle had been rounded once more (|x| times the unit roundoff), and the result stays in [-1, 1]; infinity gives NaN.
    """
    return _sin(_as_floats(x))


@jax.jit
def cos(x: ArrayLike) -> Array:
    """Cosine of an angle in rad, any shape; ranges and errors as for `sin`."""
    return _cos(_as_floats(x))


@jax.jit
def tan(x: ArrayLike) -> Array:
    """Tangent of an angle in rad, any shape: relative error below 4e-7 / 1e-15 for |x| <= pi, then slowly growing."""
    return _tan(_as_floats(x))


@jax.jit
def arctan(x: ArrayLike) -> Array:
    """Arctangent in rad, any shape; every finite or infinite x. Absolute error below 2e-7 / 4e-16."""
    return _arctan(_as_floats(x))


@jax.jit
def arctan2(y: ArrayLike, x: ArrayLike) -> Array:
    """Angle of the point (x, y) in rad, in [-pi, pi]. Absolute error below 3e-7 / 1e-15 in all quadrants.

    At (0, 0) the value is 0 (with the sign of y) and both derivatives are 0, whereas those of the library are NaN. The
    sign of a zero y chooses between pi and -pi for negative x; the sign of a zero x is ignored. Derivatives hold where
    x^2 + y^2 neither underflows nor overflows.
    """
    return _arctan2(*_same_type(y, x))


def sqrt(x: ArrayLike) -> Array:
    """Square root, any shape, correctly rounded; its derivative at 0 is 0 instead of infinite."""
    return _sqrt(_as_floats(x))


@jax.jit
def hypot(x: ArrayLike, y: ArrayLike) -> Array:
    """Length of (x, y), as sqrt(x^2 + y^2): accurate where the squares neither underflow nor overflow.

    Both derivatives at (0, 0) are 0 instead of NaN.
    """
    return _hypot(*_same_type(x, y))


@jax.jit
def log(x: ArrayLike) -> Array:
    """Natural logarithm, any shape: error below 2e-7 / 4e-16 relative to max(1, |log x|).

    0 and subnormal numbers give -infinity, negative numbers NaN.
    """
    return _log(_as_floats(x))


def log_of_normal(x: Array) -> Array:
    """Natural logarithm of positive, finite, normal float32 or float64 numbers; anything else gives a wrong number."""
    unsigned, mantissa_bits = float_layout(x)
    signed = jnp.int32 if unsigned == jnp.uint32 else jnp.int64
    origin, one = (jnp.asarray(int(np.asarray(value, x.dtype).view(signed)), signed) for value in (math.sqrt(2.0), 1.0))
    held = lax.stop_gradient(x)
    word = lax.bitcast_convert_type(held, signed)
    # x = 2^exponent * mantissa, with the mantissa between sqrt(2) and 2 sqrt(2).
    exponent = (word - origin) >> jnp.asarray(mantissa_bits, signed)
    lowered = exponent << jnp.asarray(mantissa_bits, signed)
    # Bits have no derivative. That of the mantissa is 2^-exponent, which is a normal number for all exponents but the
    # largest; there it is 0, as is 1 / x.
    slope = lax.bitcast_convert_type(one - lowered, x.dtype)
    mantissa = lax.bitcast_convert_type(word - lowered, x.dtype) + (x - held) * slope
    s = (mantissa - 2.0) / (mantissa + 2.0)
    t = s * s
    q = polynomials.evaluate(polynomials.of_dtype(x, polynomials.LOGARITHM_32, polynomials.LOGARITHM_64), t)
    return (exponent.astype(x.dtype) + 1.0) * math.log(2.0) + 2.0 * (s + s * t * q)


# Types


def _as_floats(x: ArrayLike) -> Array:
    """`x` as an array of floating point numbers; integers get the default type, as in `jax.numpy`."""
    x = jnp.asarray(x)
    if jnp.issubdtype(x.dtype, jnp.inexact):
        return x
    return x.astype(jnp.result_type(float))


def _same_type(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Both values in their common floating type; a value of that type is unchanged, weakly typed or not."""
    common = jnp.result_type(x, y)
    if not jnp.issubdtype(common, jnp.inexact):
        common = jnp.result_type(float)
    x, y = jnp.asarray(x), jnp.asarray(y)
    return x if x.dtype == common else x.astype(common), y if y.dtype == common else y.astype(common)


def _ours(*arguments: Array) -> bool:
    """Whether the polynomials apply; weakly typed values keep their weak type only in the library's functions."""
    return on_cpu() and all(x.dtype in (jnp.float32, jnp.float64) and not x.weak_type for x in arguments)


def _fence_many(values: Tree) -> Tree:
    """Arguments as arrays in memory if they are large: otherwise XLA computes them once for each use."""
    return fence(values) if jax.tree.leaves(values)[0].size >= _MANY else values


# Sine and cosine


def _reduced_sine(x: Array, half_turns: Array, sign: Array) -> Array:
    """sign * sin(x - pi * half_turns), for a difference within a quarter turn of 0."""
    first, second, third = _PI_PARTS_32 if x.dtype == jnp.float32 else _PI_PARTS_64
    r = ((x - half_turns * first) - half_turns * second) - half_turns * third
    # Far outside the range the difference is rounding noise, which must not reach the polynomial. NaN passes.
    r = jnp.clip(r, -1.6, 1.6)
    t = r * r
    q = polynomials.evaluate(polynomials.of_dtype(x, polynomials.SINE_32, polynomials.SINE_64), t)
    return sign * (r + r * t * q)


def _alternating_sign(count: Array) -> Array:
    """(-1)^count for whole numbers."""
    half = 0.5 * count
    return 1.0 - 4.0 * (half - jnp.floor(half))


@jax.custom_jvp
def _sin(x: Array) -> Array:
    if not _ours(x):
        return jnp.sin(x)
    x = _fence_many(x)
    count = jnp.round(x * (1 / math.pi))
    return _reduced_sine(x, count, _alternating_sign(count))


@jax.custom_jvp
def _cos(x: Array) -> Array:
    if not _ours(x):
        return jnp.cos(x)
    x = _fence_many(x)
    # cos(r + pi / 2 + n pi) = -(-1)^n sin(r): the reduction subtracts n + 1/2 half turns.
    count = jnp.round(x * (1 / math.pi) - 0.5)
    return _reduced_sine(x, count + 0.5, -_alternating_sign(count))


@jax.custom_jvp
def _tan(x: Array) -> Array:
    if not _ours(x):
        return jnp.tan(x)
    return _sin(x) / _cos(x)


@_sin.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (x,), (dx,) = primals, tangents
    return _sin(x), _cos(x) * dx


@_cos.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (x,), (dx,) = primals, tangents
    return _cos(x), -_sin(x) * dx


@_tan.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (x,), (dx,) = primals, tangents
    tangent = _tan(x)
    return tangent, (1.0 + tangent * tangent) * dx


# Arctangent


def _three_ranges(height: Array, width: Array) -> tuple[Array, Array, Array]:
    """arctan(height / width), both not negative, as turned + arctan(top / bottom) with a quotient within tan(pi / 8) of 0.

    Above tan(pi / 8) it is pi / 4 + arctan((h - w) / (h + w)), above tan(3 pi / 8) it is pi / 2 + arctan(-w / h), so that
    half the terms of the polynomial suffice.
    """
    middle, steep = height > _TANGENT_OF_PI_8 * width, height > _TANGENT_OF_3_PI_8 * width
    top = jnp.where(steep, -width, jnp.where(middle, height - width, height))
    bottom = jnp.where(steep, height, jnp.where(middle, height + width, width))
    turned = jnp.where(steep, math.pi / 2, jnp.where(middle, math.pi / 4, 0.0))
    return turned, top, bottom


def _arctan_polynomial(turned: Array, r: Array) -> Array:
    t = r * r
    q = polynomials.evaluate(polynomials.of_dtype(r, polynomials.ARCTANGENT_32, polynomials.ARCTANGENT_64), t)
    return turned + (r + r * t * q)


@jax.custom_jvp
def _arctan(x: Array) -> Array:
    if not _ours(x):
        return jnp.arctan(x)
    x = _fence_many(x)
    # |x| as a product, because the derivative of |x| is 0 at 0.
    sign = sign_of(x)
    turned, top, bottom = _three_ranges(sign * x, jnp.ones_like(x))
    return sign * _arctan_polynomial(turned, top / bottom)


@jax.custom_jvp
def _arctan2(y: Array, x: Array) -> Array:
    if not _ours(x, y):
        return _library_arctan2(y, x)
    x, y = _fence_many(jnp.broadcast_arrays(x, y))
    largest = float(jnp.finfo(x.dtype).max) / 4  # so that infinities and sums of the two stay finite
    sign = sign_of(y)
    left = x < 0.0
    width, height = (jnp.where(z > largest, largest, z) for z in (jnp.where(left, -x, x), sign * y))
    turned, top, bottom = _three_ranges(height, width)
    # 0 / 0 counts as 0 / infinity: 0, and so are all its derivatives.
    angle = _arctan_polynomial(turned, top / jnp.where(bottom == 0.0, jnp.inf, bottom))
    return sign * jnp.where(left, math.pi - angle, angle)


def _library_arctan2(y: Array, x: Array) -> Array:
    origin = (x == 0.0) & (y == 0.0)
    # A zero x becomes +0, with the derivative of x.
    width = jnp.where(x == 0.0, x - lax.stop_gradient(x), x)
    return jnp.arctan2(jnp.where(origin, lax.stop_gradient(y), y), jnp.where(origin, 1.0, width))


@_arctan.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (x,), (dx,) = primals, tangents
    return _arctan(x), dx / (1.0 + x * x)


@_arctan2.defjvp
def _(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> tuple[Array, Array]:
    (y, x), (dy, dx) = primals, tangents
    square = x * x + y * y
    inverse = jnp.where(square == 0.0, 0.0, 1.0 / jnp.where(square == 0.0, 1.0, square))
    return _arctan2(y, x), (x * inverse) * dy - (y * inverse) * dx


# Roots and logarithm


def _sqrt(x: Array) -> Array:
    # At 0 both the argument and the result are constants, so that an infinite slope is multiplied by zero in either
    # mode. XLA sees a choice between equal values, which costs nothing.
    zero = x == 0.0
    root = jnp.sqrt(jnp.where(zero, lax.stop_gradient(x), x))
    return jnp.where(zero, lax.stop_gradient(root), root)


def _hypot(x: Array, y: Array) -> Array:
    return _sqrt(x * x + y * y)


@jax.custom_jvp
def _log(x: Array) -> Array:
    if not _ours(x):
        return jnp.log(x)
    smallest = float(jnp.finfo(x.dtype).tiny)
    value = jnp.where(x >= smallest, log_of_normal(x), jnp.where(x >= 0.0, -jnp.inf, jnp.nan))
    return jnp.where(x == jnp.inf, jnp.inf, value)


@_log.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (x,), (dx,) = primals, tangents
    return _log(x), dx / x
