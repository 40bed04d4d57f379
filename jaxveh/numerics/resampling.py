"""Resampling: the choice of an ancestor for each particle of the next generation.

Every scheme takes weights (N,), not negative and finite with a positive sum, normalised or not, and returns ancestors
(n,), int32 and nondecreasing, by default with n = N. The expected number of children of particle i is n w_i / sum(w).

Cumulated weights are whole numbers: the sum has 2^30 (float32) or 2^52 (float64) parts. Sums of whole numbers are exact
in any order, so that rounding cannot lose a particle, go past the last one, break the order, or choose a particle of
zero weight; a weight below half a part counts as zero. Ancestors are integers: no gradient passes through them.

A filter holds a scheme as a static field, which a copy or a pickle of the filter must equal. The public functions are
therefore plain functions, which call compiled ones: what `jax.jit` returns is not equal to its copy, nor can it be pickled.
"""

import math
import operator
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from jaxveh.numerics import random, sums
from jaxveh.numerics.divisors import or_one
from jaxveh.numerics.elementary import log
from jaxveh.numerics.fences import fence
from jaxveh.numerics.platform import on_cpu


def systematic(key: Array, weights: Array, n: int | None = None) -> Array:
    """One uniform offset for all n strata (Kitagawa, 1996): each particle has its expected number of children, +- 1."""
    return _systematic(key, weights, n)


@partial(jax.jit, static_argnums=2, static_argnames="n")
def _systematic(key: Array, weights: Array, n: int | None) -> Array:
    n = _size(weights, n)
    parts, total = _cumulated_parts(weights)
    offset = random.uniform(key, (), weights.dtype)
    position = _position(parts, total, n, weights.dtype)
    return _ancestors(jnp.where(parts == total, n, jnp.ceil(position - offset).astype(jnp.int32)), n)


def stratified(key: Array, weights: Array, n: int | None = None) -> Array:
    """One uniform offset for each of n strata (Kitagawa, 1996)."""
    return _stratified(key, weights, n)


@partial(jax.jit, static_argnums=2, static_argnames="n")
def _stratified(key: Array, weights: Array, n: int | None) -> Array:
    n = _size(weights, n)
    parts, total = _cumulated_parts(weights)
    offsets = fence(random.uniform(key, (n,), weights.dtype))
    position = _position(parts, total, n, weights.dtype)
    whole = jnp.minimum(jnp.floor(position), n - 1)
    stratum = fence(whole.astype(jnp.int32))
    # All strata below that of the position are passed, and its own stratum if its offset is below the position.
    passed = stratum + (offsets[stratum] < position - whole).astype(jnp.int32)
    return _ancestors(jnp.where(parts == total, n, passed), n)


def multinomial(key: Array, weights: Array, n: int | None = None) -> Array:
    """n independent draws in ascending order, by sorted uniform numbers from exponential spacings and a binary search."""
    return _multinomial(key, weights, n)


@partial(jax.jit, static_argnums=2, static_argnames="n")
def _multinomial(key: Array, weights: Array, n: int | None) -> Array:
    n = _size(weights, n)
    parts, total = _cumulated_parts(weights)
    return _search(parts, _sorted_parts(key, n, jnp.asarray(n, jnp.int32), total, weights.dtype))


def residual(key: Array, weights: Array, n: int | None = None) -> Array:
    """floor(n w_i) children of each particle, the others by multinomial draws from the remainders (Liu and Chen, 1998)."""
    return _residual(key, weights, n)


@partial(jax.jit, static_argnums=2, static_argnames="n")
def _residual(key: Array, weights: Array, n: int | None) -> Array:
    n = _size(weights, n)
    expected = weights * (n / jnp.sum(weights))
    # An expected number just below a whole number by rounding counts as that whole number.
    certain = jnp.floor(expected * (1.0 + 8.0 * float(jnp.finfo(weights.dtype).eps)))
    remainder = jnp.maximum(expected - certain, 0.0)
    certain = certain.astype(jnp.int32)
    missing = n - jnp.sum(certain, dtype=jnp.int32)
    parts, total = _cumulated_parts(jnp.where(missing > 0, remainder, 1.0))
    drawn = _search(parts, _sorted_parts(key, n, missing, total, weights.dtype))
    draw = jax.lax.iota(jnp.int32, n)
    children = certain.at[drawn].add((draw < missing).astype(jnp.int32), mode="promise_in_bounds")
    return _ancestors(_cumulative_sum(children), n)


def ess(weights: Array) -> Array:
    """Effective sample size (sum w)^2 / sum w^2 of weights (N,), from 1 to N; 0 if all are zero (Kong et al., 1994)."""
    return _ess(weights)


@jax.jit
def _ess(weights: Array) -> Array:
    square = sums.total(weights * weights)
    total = sums.total(weights)
    return jnp.where(square > 0.0, total * total / or_one(square, square > 0.0), 0.0)


def normalise(log_weights: Array) -> tuple[Array, Array, Array]:
    """From log weights (N,): weights that sum to 1, the logarithm of the mean weight, and whether any particle is alive.

    An entry that is not finite is dead and gets weight 0. If all entries are dead, the weights are uniform, the logarithm is
    -infinity and `alive` is False. Gradients are finite in every case, and zero with respect to dead entries.
    """
    return _normalise(log_weights)


@jax.jit
def _normalise(log_weights: Array) -> tuple[Array, Array, Array]:
    count = log_weights.shape[-1]
    living = jnp.isfinite(log_weights)
    alive = jnp.any(living)
    largest = jax.lax.stop_gradient(jnp.max(jnp.where(living, log_weights, -jnp.inf)))
    largest = jnp.where(alive, largest, 0.0)
    shifted = jnp.where(living, log_weights, largest) - largest
    raw = fence(jnp.where(living, jnp.exp(shifted), 0.0))
    total = jnp.where(alive, sums.total(raw), 1.0)
    weights = jnp.where(alive, raw * (1.0 / total), 1.0 / count)
    log_mean = jnp.where(alive, largest + log(total) - math.log(count), -jnp.inf)
    return weights, log_mean, alive


def _size(weights: Array, n: int | None) -> int:
    if weights.ndim != 1 or weights.shape[0] == 0:
        raise ValueError(
            f"weights have shape {weights.shape}; they must be (N,) with N >= 1: use jax.vmap for batches."
        )
    if not jnp.issubdtype(weights.dtype, jnp.floating):
        raise ValueError(f"weights are {weights.dtype.name}; they must be float32 or float64: convert them.")
    n = weights.shape[0] if n is None else operator.index(n)
    if not 1 <= n < 2**30:
        raise ValueError(f"n is {n}; the number of ancestors must be between 1 and 2^30.")
    return n


def _cumulated_parts(weights: Array) -> tuple[Array, Array]:
    """Cumulated weights in whole parts (N,), and their sum: 2^30 or 2^52, except for rounding."""
    parts = _as_parts(weights)
    cumulated = fence(_cumulative_sum(parts))
    return cumulated, cumulated[-1]


def _cumulative_sum(values: Array) -> Array:
    """Cumulative sum of whole numbers (N,); on the CPU the library's function takes up to three times as long."""
    return _cumulated_by_blocks(values) if on_cpu() else jax.lax.cumsum(values)


def _cumulated_by_blocks(values: Array) -> Array:
    """Cumulative sums within blocks of 8, for all blocks at once, plus the cumulated sums of the blocks before."""
    size, block = values.shape[0], 8
    count = -(-size // block)
    blocks = jax.lax.pad(values, jnp.zeros((), values.dtype), [(0, count * block - size, 0)]).reshape(count, block)
    columns = [blocks[:, 0]]
    for j in range(1, block):
        columns.append(columns[-1] + blocks[:, j])
    sums = fence(jnp.stack(columns, axis=1))
    if count > 1:
        totals = sums[:, -1]
        sums = sums + (_cumulated_by_blocks(totals) - totals)[:, None]
    return sums.reshape(-1)[:size]


def _as_parts(weights: Array) -> Array:
    bits, integer = (30, jnp.int32) if weights.dtype == jnp.float32 else (52, jnp.int64)
    return fence(jnp.round(weights * (2.0**bits / sums.total(weights))).astype(integer))


def _position(parts: Array, total: Array, n: int, dtype: jnp.dtype) -> Array:
    """n times the cumulated weight, in [0, n]: monotone, because each operation is."""
    return parts.astype(dtype) * (n / total.astype(dtype))


def _ancestors(passed: Array, n: int) -> Array:
    """Ancestors (n,), where `passed` (N,) is the number of children of all particles up to and including each; the last is n."""
    passed = fence(jnp.clip(passed, 0, n))
    ended = jnp.zeros(n, jnp.int32).at[passed].add(1, mode="drop", indices_are_sorted=True)
    return fence(_cumulative_sum(fence(ended)))


def _sorted_parts(key: Array, n: int, count: Array, total: Array, dtype: jnp.dtype) -> Array:
    """(n,) whole numbers in [0, total): `count` sorted uniform numbers, then numbers without meaning."""
    spacing = random.exponential(key, (n + 1,), dtype)
    used = jax.lax.iota(jnp.int32, n + 1) <= count
    cumulated = fence(_cumulative_sum(_as_parts(jnp.where(used, spacing, 0.0))))
    uniform = cumulated[:-1].astype(dtype) * (1.0 / cumulated[-1].astype(dtype))
    drawn = jnp.floor(uniform * total.astype(dtype)).astype(total.dtype)
    return jnp.clip(drawn, 0, total - 1)


def _search(cumulated: Array, drawn: Array) -> Array:
    """The first particle whose cumulated parts exceed each drawn number."""
    return fence(jnp.searchsorted(cumulated, drawn, side="right").astype(jnp.int32))
