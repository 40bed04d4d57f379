"""Random sequences of devices, drawn from one key; without a key (None) all of them are zero."""

from __future__ import annotations

import math
import zlib
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics


def subkey(key: Any, tag: int | str) -> Any:
    """A separate key for each tag, a number or a name; None stays None.

    A name is used by its CRC-32, which is the same on every machine and in every run.
    """
    number = zlib.crc32(tag.encode()) if isinstance(tag, str) else tag
    return None if key is None else jax.random.fold_in(key, number)


def white(key: Any, n: int, dtype: Any) -> jax.Array:
    """`n` independent standard normal numbers."""
    return jnp.zeros(n, dtype) if key is None else numerics.normal(key, (n,), dtype)


def walk(key: Any, n: int, rate: jax.Array, period: float, dtype: Any) -> jax.Array:
    """A random walk from 0 at the first of `n` instants: variance `rate^2 t`, `rate` in unit per root second."""
    steps = rate * (math.sqrt(period) * white(key, n, dtype))
    return jnp.cumsum(steps.at[0].set(0.0))


def gauss_markov(key: Any, n: int, rate: jax.Array, time: jax.Array, period: float, dtype: Any) -> jax.Array:
    """A first-order Gauss-Markov process from 0, driven like the random walk, with the correlation time `time` (s).

    Its variance is `rate^2 time / 2 (1 - exp(-2 t / time))`: that of the random walk at first, then constant (Brown &
    Hwang, Introduction to Random Signals and Applied Kalman Filtering, 4th ed., section 4.2). The steps are exact.
    """
    kept = jnp.exp(-period / time)
    spread = rate * numerics.sqrt(-0.5 * time * jnp.expm1(-2 * period / time))

    def body(value, step):
        value = kept * value + spread * step
        return value, value

    start = jnp.zeros((), dtype)
    _, rest = jax.lax.scan(body, start, white(key, n, dtype)[1:])
    return jnp.concatenate([start[None], rest])


def on_and_off(key: Any, n: int, start_rate: jax.Array, mean_length: jax.Array, period: float) -> jax.Array:
    """Whether each of `n` instants lies in a random outage; outages begin at `start_rate` (1/s) and last `mean_length`
    (s) on average.

    It is a Markov chain of two states (Gilbert, Capacity of a burst-noise channel, 1960) that begins without an outage,
    with the transition probabilities of the process in continuous time over one period.
    """
    if key is None:
        return jnp.zeros(n, bool)
    end_rate = 1.0 / mean_length
    both = start_rate + end_rate
    mixed = -jnp.expm1(-both * period) / both
    begins, ends = start_rate * mixed, end_rate * mixed

    def body(out, u):
        out = jnp.where(out, u >= ends, u < begins)
        return out, out

    u = numerics.uniform(key, (n - 1,), begins.dtype)
    _, rest = jax.lax.scan(body, jnp.zeros((), bool), u)
    return jnp.concatenate([jnp.zeros(1, bool), rest])
