"""Random signals of unit variance as sums of harmonics: smooth, with a given spectrum, the same for the same key.

Every harmonic has the same energy, a random frequency in its own part of the spectrum, and a random phase (M. Shinozuka
and C.-M. Jan, J. Sound and Vibration 25 (1972), with parts of equal energy). Averaged over keys, mean, variance and
autocorrelation are those of the spectrum; over a long stretch of one signal they tend to these values.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from jaxveh._core.errors import InputError, check_key
from jaxveh.numerics.elementary import arctan, cos, tan
from jaxveh.numerics.random import uniform


def band_harmonics(
    key: Array, lowest: float, highest: float, count: int, dtype: DTypeLike | None = None
) -> tuple[Array, Array]:
    """Frequencies and phases (rad), (count,) each, of a signal that is white between two frequencies and has no energy
    elsewhere."""
    share, phases = _shares(key, count, dtype)
    return lowest + (highest - lowest) * share, phases


def gauss_markov_harmonics(
    key: Array, length: float, highest: float, count: int, dtype: DTypeLike | None = None
) -> tuple[Array, Array]:
    """Frequencies and phases (rad), (count,) each, of a signal with the autocorrelation `exp(-|lag| / length)`.

    Its one-sided spectral density is `4 L / (1 + (2 pi f L)^2)` with L the correlation `length` (of the argument's
    unit), cut off above the `highest` frequency so that the signal has derivatives; the rest is scaled to variance 1.
    """
    share, phases = _shares(key, count, dtype)
    # The integral of the density is (2 / pi) atan(2 pi f L): frequencies of equal energy are tangents.
    turn = 2.0 * math.pi * length
    return tan(share * arctan(turn * highest)) / turn, phases


def sum_of_harmonics(x: Array, frequencies: Array, phases: Array) -> Array:
    """`sqrt(2 / n) sum cos(2 pi f x + phase)` over n harmonics: variance 1, in the shape of x.

    `frequencies` and `phases` are (n,). **Raises** `InputError` for others.
    """
    shapes = jnp.shape(frequencies), jnp.shape(phases)
    if len(shapes[0]) != 1 or shapes[0] != shapes[1] or 0 in shapes[0]:
        raise InputError(
            f"frequencies, phases have shapes {shapes[0]}, {shapes[1]}: must be (n,), a pair for each harmonic."
        )
    angles = (2.0 * math.pi) * (x[..., None] * frequencies) + phases
    return math.sqrt(2.0 / frequencies.shape[-1]) * jnp.sum(cos(angles), axis=-1)


def _shares(key: Array, count: int, dtype: DTypeLike | None) -> tuple[Array, Array]:
    """One random number in each of `count` equal parts of (0, 1), and random phases."""
    check_key("random harmonics", key)
    places, phases = jax.random.split(key)
    inside = uniform(places, (count,), dtype)
    return (jnp.arange(count, dtype=inside.dtype) + inside) / count, (2.0 * math.pi) * uniform(phases, (count,), dtype)
