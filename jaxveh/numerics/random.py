"""Random numbers by transformations of threefry words, without rejection and without long library functions.

The words are those of `jax.random` for the same key, but both halves of each block are used and the rounds are
written out, which on the CPU is several times faster. Keys are of the generator threefry2x32, jax's default, typed or
raw, one at a time: batches of keys go through `vmap`. On an accelerator normal numbers are `jax.random.normal`.
"""

import math
import operator
from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from jaxveh.numerics.elementary import log_of_normal, sqrt
from jaxveh.numerics.fences import fence
from jaxveh.numerics.platform import barriers_hold, on_cpu
from jaxveh.numerics.words import half_turn_of_word, sin_cos_of_word

Shape = int | Sequence[int]

_ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
_KEY_PARITY = 0x1BD11BDA


def normal(key: Array, shape: Shape = (), dtype: DTypeLike | None = None) -> Array:
    """Standard normal numbers of `shape` by Box and Muller (1958), float32 or float64 (the default type if None).

    Never infinite; two words of 32 bits make two numbers, whatever the type, so that |z| is at most 6.7: the
    probability of larger values is 1.4e-11.
    """
    return _normal(key, _shape(shape), _dtype(dtype))


def normals(key: Array, count: int, shape: Shape = (), dtype: DTypeLike | None = None) -> tuple[Array, ...]:
    """`count` independent arrays of `shape` with standard normal numbers, such as one for each field of a state.

    Cheaper than rows of one array from `normal`, because nothing is concatenated; the numbers differ from those of `normal`.
    """
    shape, count = _shape(shape), operator.index(count)
    if count < 0 or count * math.prod(shape) >= 2**31:
        raise ValueError(
            f"{count} arrays of shape {shape} from one key; at most 2^31 - 1 numbers are possible: split the key."
        )
    return _normals(key, count, shape, _dtype(dtype))


def uniform(key: Array, shape: Shape = (), dtype: DTypeLike | None = None) -> Array:
    """Uniform numbers of `shape` in the open interval (0, 1): odd multiples of 2^-24 (float32) or 2^-53 (float64)."""
    return _uniform(key, _shape(shape), _dtype(dtype))


def exponential(key: Array, shape: Shape = (), dtype: DTypeLike | None = None) -> Array:
    """Exponential numbers of mean 1 of `shape`, in [0, 22.9] (float32) or [0, 45.1] (float64)."""
    return _exponential(key, _shape(shape), _dtype(dtype))


def cauchy(key: Array, shape: Shape = (), dtype: DTypeLike | None = None) -> Array:
    """Standard Cauchy numbers of `shape`, tangents of random angles; |z| is at most 7e8 (float32) or 3e18 (float64)."""
    return _cauchy(key, _shape(shape), _dtype(dtype))


def student_t(key: Array, df: ArrayLike, shape: Shape = (), dtype: DTypeLike | None = None) -> Array:
    """Student's t numbers of `shape` by Bailey's polar method, with `df` > 0 degrees of freedom.

    `df` broadcasts against `shape` and is differentiable. sqrt(df (u^(-2 / df) - 1)) cos(theta) is exact for every df
    (Bailey, Mathematics of Computation 62, 1994). |t| is at most sqrt(df (2^(66 / df) - 1)) in float32, with 130
    instead of 66 in float64, and at most the square root of the largest number.
    """
    dtype = _dtype(dtype)
    return _student_t(key, jnp.asarray(df, dtype), _shape(shape), dtype)


# The computations, each compiled as one program: without jit they would be dozens of small programs.


@partial(jax.jit, static_argnums=(1, 2))
def _normal(key: Array, shape: tuple[int, ...], dtype: jnp.dtype) -> Array:
    if not on_cpu():
        return jax.random.normal(key, shape, dtype)
    count = math.prod(shape)
    half = (count + 1) // 2
    if barriers_hold():
        sines, cosines = _normal_pairs(key, half, dtype)
        return fence(jnp.concatenate((sines, cosines))[:count]).reshape(shape)
    # The same numbers without a concatenation, into which XLA would fuse everything, scalar by scalar.
    place, first_half = _places(count)
    sines, cosines = _box_muller(*_blocks(key, place), dtype)
    return jnp.where(first_half, sines, cosines).reshape(shape)


@partial(jax.jit, static_argnums=(1, 2, 3))
def _normals(key: Array, count: int, shape: tuple[int, ...], dtype: jnp.dtype) -> tuple[Array, ...]:
    size, pairs = math.prod(shape), (count + 1) // 2
    if not on_cpu():
        return tuple(jax.random.normal(key, (count, *shape), dtype))
    sines, cosines = _normal_pairs(key, pairs * size, dtype)
    rows = [values[i * size : (i + 1) * size] for values in (sines, cosines) for i in range(pairs)]
    return tuple(row.reshape(shape) for row in rows[:count])


@partial(jax.jit, static_argnums=(1, 2))
def _uniform(key: Array, shape: tuple[int, ...], dtype: jnp.dtype) -> Array:
    word = _words(key, math.prod(shape), dtype)
    kept = int(jnp.finfo(dtype).nmant)
    dropped = jnp.asarray(8 * word.dtype.itemsize - kept, word.dtype)
    return (((word >> dropped).astype(dtype) + 0.5) * 2.0**-kept).reshape(shape)


@partial(jax.jit, static_argnums=(1, 2))
def _exponential(key: Array, shape: tuple[int, ...], dtype: jnp.dtype) -> Array:
    return -log_of_normal(_positive_unit(_words(key, math.prod(shape), dtype), dtype)).reshape(shape)


@partial(jax.jit, static_argnums=(1, 2))
def _cauchy(key: Array, shape: tuple[int, ...], dtype: jnp.dtype) -> Array:
    sine, cosine = sin_cos_of_word(_words(key, math.prod(shape), dtype), dtype)
    return (sine / cosine).reshape(shape)


@partial(jax.jit, static_argnums=(2, 3))
def _student_t(key: Array, df: Array, shape: tuple[int, ...], dtype: jnp.dtype) -> Array:
    count = math.prod(shape)
    first, second = fence(_word_pairs(key, jax.lax.iota(jnp.uint32, count), count, dtype))
    surprise = -2.0 * log_of_normal(_positive_unit(first, dtype)).reshape(shape)
    largest = 0.9 * math.log(float(jnp.finfo(dtype).max))  # so that the square root's argument stays finite
    radius = sqrt(df * jnp.expm1(jnp.minimum(surprise / df, largest)))
    _, cosine = sin_cos_of_word(second, dtype)
    return radius * cosine.reshape(shape)


def _shape(shape: Shape) -> tuple[int, ...]:
    sizes = tuple(map(operator.index, shape)) if isinstance(shape, Sequence) else (operator.index(shape),)
    if math.prod(sizes) >= 2**31:
        raise ValueError(f"shape {sizes} from one key; at most 2^31 - 1 numbers are possible: split the key.")
    return sizes


def _dtype(dtype: DTypeLike | None) -> jnp.dtype:
    chosen = jnp.dtype(jnp.result_type(float) if dtype is None else dtype)
    if chosen not in (jnp.dtype("float32"), jnp.dtype("float64")):
        raise ValueError(f"dtype is {chosen.name}; it must be float32 or float64: draw in one of these and convert.")
    if chosen != jax.dtypes.canonicalize_dtype(chosen):
        raise ValueError("dtype is float64, but 64-bit types are off; ask for float32, or set jax_enable_x64 first.")
    return chosen


def _positive_unit(word: Array, dtype: jnp.dtype) -> Array:
    """(word + 1/2) / 2^bits, in (0, 1]: the smallest number keeps all bits, the largest may round to 1."""
    bits = 8 * word.dtype.itemsize
    return word.astype(dtype) * 2.0**-bits + 2.0 ** (-bits - 1)


def _box_muller(first: Array, second: Array, dtype: jnp.dtype) -> tuple[Array, Array]:
    """Two independent standard normal numbers from two random words, elementwise."""
    radius = jnp.sqrt(-2.0 * log_of_normal(_positive_unit(first, dtype)))
    sine, cosine = half_turn_of_word(second, dtype)
    return radius * sine, radius * cosine


def _normal_pairs(key: Array, count: int, dtype: jnp.dtype) -> tuple[Array, Array]:
    return fence(_box_muller(*_stored_blocks(key, count), dtype))


def _words(key: Array, count: int, dtype: jnp.dtype) -> Array:
    """`count` words as wide as `dtype`."""
    if dtype == jnp.float64:
        return fence(_double_words(key, jax.lax.iota(jnp.uint32, count)))
    if barriers_hold():
        return jnp.concatenate(fence(_blocks(key, jax.lax.iota(jnp.uint32, (count + 1) // 2))))[:count]
    place, first_half = _places(count)
    return jnp.where(first_half, *_blocks(key, place))


def _places(count: int) -> tuple[Array, Array]:
    """For each of `count` numbers, its block and whether it is the first word of the block; the first half are first words."""
    half = _uint32((count + 1) // 2)
    index = jax.lax.iota(jnp.uint32, count)
    first_half = index < half
    return jnp.where(first_half, index, index - half), first_half


def _word_pairs(key: Array, place: Array, count: int, dtype: jnp.dtype) -> tuple[Array, Array]:
    """Two words as wide as `dtype` for each place; all places are below `count`."""
    if dtype == jnp.float32:
        return _blocks(key, place)
    return _double_words(key, place), _double_words(key, place + _uint32(count))


def _double_words(key: Array, place: Array) -> Array:
    high, low = (word.astype(jnp.uint64) for word in _blocks(key, place))
    return (high << jnp.asarray(32, jnp.uint64)) | low


def _blocks(key: Array, place: Array) -> tuple[Array, Array]:
    """Both words of the blocks numbered `place` of threefry-2x32 with 20 rounds (Salmon et al., SC 2011)."""
    if str(jax.random.key_impl(key)) != "threefry2x32":
        raise ValueError(
            f"key is of the generator {jax.random.key_impl(key)}; it must be of threefry2x32: "
            "make it by jax.random.key(seed, impl='threefry2x32')."
        )
    data = jax.random.key_data(key)
    if data.shape != (2,):
        raise ValueError(f"key has shape {data.shape[:-1]}; it must be one key: use jax.vmap over several.")
    subkeys = (data[0], data[1], data[0] ^ data[1] ^ _uint32(_KEY_PARITY))
    left = jnp.broadcast_to(subkeys[0], place.shape)
    right = place + subkeys[1]
    for group in range(5):
        for rotation in _ROTATIONS[group % 2]:
            left = left + right
            right = ((right << _uint32(rotation)) | (right >> _uint32(32 - rotation))) ^ left
        left = left + subkeys[(group + 1) % 3]
        right = right + subkeys[(group + 2) % 3] + _uint32(group + 1)
    return left, right


def _stored_blocks(key: Array, count: int) -> tuple[Array, Array]:
    """Both words of the first `count` blocks, computed once: XLA would compute a block for each of its two words."""
    place = jax.lax.iota(jnp.uint32, count)
    if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        return fence(_blocks(key, place))
    both = fence(_double_words(key, place))
    return (both >> jnp.asarray(32, jnp.uint64)).astype(jnp.uint32), both.astype(jnp.uint32)


def _uint32(value: int) -> Array:
    return jnp.asarray(value, jnp.uint32)
