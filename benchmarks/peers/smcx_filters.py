"""The unscented and the particle filters of `smcx`, jitted."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import smcx

from ..problems import SingleTrack, SpeedAndMass
from .jax_models import gaussian_arrays, single_track_functions, speed_functions

__all__ = ["particle_filter", "unscented"]


def unscented(problem: SpeedAndMass, dtype: np.typing.DTypeLike) -> Callable:
    """A jitted function of the measured speeds (rows,) of one run or (runs, rows): means and log-likelihood."""
    transition, observation = speed_functions(problem)
    arrays = gaussian_arrays(problem, dtype)

    def one(speed: jax.Array) -> tuple[jax.Array, jax.Array]:
        done = smcx.unscented_kalman_filter(
            arrays["mean"],
            arrays["covariance"],
            transition,
            arrays["process"],
            observation,
            arrays["measurement"],
            speed[:, None],
            alpha=problem.alpha,
            beta=problem.beta,
            kappa=problem.kappa,
            inputs=arrays["inputs"],
        )
        variances = jnp.diagonal(done.filtered_covariances, axis1=-2, axis2=-1)
        return done.filtered_means, jnp.sqrt(variances), done.marginal_loglik

    return jax.jit(lambda speed: one(speed) if speed.ndim == 1 else jax.vmap(one)(speed))


def particle_filter(problem: SingleTrack, count: int, *, auxiliary: bool, dtype: np.typing.DTypeLike) -> Callable:
    """A jitted function of the key: weighted means (rows, 11) and log-likelihood.

    Input row t holds what the step into t was driven with, and what the measurement at t sees.
    """
    p = problem
    move, log_likelihood = single_track_functions(p)
    before = np.maximum(np.arange(p.rows) - 1, 0)
    inputs = jnp.asarray(np.stack([p.steer[before], p.speed[before], p.steer, p.speed], axis=1), dtype)
    emissions = jnp.asarray(np.stack([p.yaw_rate, p.lateral_acceleration], axis=1), dtype)
    mean, spread, noise = (jnp.asarray(a, dtype) for a in (p.prior_mean, p.prior_std, p.process_std))

    def initial(key, n, u):
        return mean + spread * jax.random.normal(key, (n, 11), dtype)

    def transition(key, x, u):
        return move(x, u[0], u[1]) + noise * jax.random.normal(key, (11,), dtype)

    def observe(y, x, u):
        return log_likelihood(y, x, u[2], u[3])

    def look_ahead(y, x, u):
        return log_likelihood(y, move(x, u[0], u[1]), u[2], u[3])

    functions = (initial, transition, observe, look_ahead) if auxiliary else (initial, transition, observe)
    filter_ = smcx.auxiliary_filter if auxiliary else smcx.bootstrap_filter

    def run(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        # A threshold above one resamples before every step.
        done = filter_(key, *functions, emissions, count, resampling_threshold=1.1, inputs=inputs)
        return smcx.weighted_mean(done), done.marginal_loglik

    return jax.jit(run)
