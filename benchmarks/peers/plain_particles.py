"""A plain problem as functions of one particle in `jax.numpy`, with the guided proposal that all contestants use."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular

if TYPE_CHECKING:
    from ..plain import Plain

__all__ = ["Guide", "ParticleFunctions", "guide", "over_keys", "particle_functions"]

LOG_2PI = float(np.log(2 * np.pi))


class ParticleFunctions(NamedTuple):
    """A problem as functions of one particle.

    ``start(key)`` draws from the prior (n,), ``move(key, x, u)`` from the transition; ``log_transition(new, x, u)`` and
    ``log_likelihood(y, x, u)`` are log-densities. ``u`` is the row of inputs of ``new`` and ``y``.
    """

    start: Callable
    move: Callable
    log_transition: Callable
    log_likelihood: Callable


def particle_functions(plain: Plain, dtype: np.typing.DTypeLike) -> ParticleFunctions:
    """Return the functions of a problem with independent noises, whose covariances are diagonal."""
    mean, spread, noise, error = _arrays(plain, dtype)
    draw = lambda key: jax.random.normal(key, mean.shape, dtype)
    return ParticleFunctions(
        start=lambda key: mean + spread * draw(key),
        move=lambda key, x, u: plain.transition(x, u) + noise * draw(key),
        log_transition=lambda new, x, u: _log_normal((new - plain.transition(x, u)) / noise, noise),
        log_likelihood=lambda y, x, u: _log_normal((y - plain.observation(x, u)) / error, error),
    )


class Guide(NamedTuple):
    """The proposal: ``draw(key, x, y, u)`` a new particle (n,), and ``log_density(y, new, x, u)``."""

    draw: Callable
    log_density: Callable


def guide(plain: Plain, dtype: np.typing.DTypeLike) -> Guide:
    """Return a Kalman update of each particle's process noise, linearised at the state after the transition.

    For a linear problem it is the optimal proposal, and gain and factor are the same for all particles: they are precomputed.
    """
    _, _, noise, error = _arrays(plain, dtype)
    Q, R = jnp.diag(noise**2), jnp.diag(error**2)

    def update(H: jax.Array) -> tuple[jax.Array, jax.Array]:
        gain = jax.scipy.linalg.solve(H @ Q @ H.T + R, H @ Q, assume_a="pos").T
        return gain, jnp.linalg.cholesky(Q - gain @ H @ Q)

    known = None if plain.matrices is None else update(jnp.asarray(plain.matrices[2], dtype))

    def proposal(x: jax.Array, y: jax.Array, u: jax.Array) -> tuple[jax.Array, jax.Array]:
        moved = plain.transition(x, u)
        gain, factor = known or update(jax.jacfwd(plain.observation)(moved, u))
        return moved + gain @ (y - plain.observation(moved, u)), factor

    def draw(key: jax.Array, x: jax.Array, y: jax.Array, u: jax.Array) -> jax.Array:
        mean, factor = proposal(x, y, u)
        return mean + factor @ jax.random.normal(key, mean.shape, dtype)

    inverse = None if known is None else jnp.linalg.inv(known[1])

    def log_density(y: jax.Array, new: jax.Array, x: jax.Array, u: jax.Array) -> jax.Array:
        mean, factor = proposal(x, y, u)
        white = solve_triangular(factor, new - mean, lower=True) if inverse is None else inverse @ (new - mean)
        return _log_normal(white, jnp.diagonal(factor))

    return Guide(draw, log_density)


def over_keys(one: Callable) -> Callable:
    """Return a jitted function of measurements (rows, m) and a key, or of (runs, rows, m) and one key per run."""
    return jax.jit(lambda y, key: (one if y.ndim == 2 else jax.vmap(one))(y, key))


def _log_normal(white: jax.Array, scales: jax.Array) -> jax.Array:
    return -0.5 * jnp.sum(white**2 + LOG_2PI) - jnp.sum(jnp.log(scales))


def _arrays(plain: Plain, dtype: np.typing.DTypeLike) -> list[jax.Array]:
    """Return the prior's mean and standard deviations, and those of process and measurements."""
    spreads = [np.sqrt(np.diag(P)) for P in (plain.covariance, plain.process, plain.noise)]
    return [jnp.asarray(a, dtype) for a in (plain.mean, *spreads)]
