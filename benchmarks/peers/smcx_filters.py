"""The Gaussian and the particle filters of `smcx`, jitted."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
import smcx

from ..problems import SingleTrack, SpeedAndMass
from .jax_models import gaussian_arrays, over_runs, single_track_functions, speed_functions
from .plain_particles import guide, over_keys, particle_functions

if TYPE_CHECKING:
    from ..plain import Plain

__all__ = [
    "extended",
    "extended_smoother",
    "guided",
    "kalman",
    "kalman_smoother",
    "liu_west",
    "particle_filter",
    "unscented",
    "unscented_filter",
]


def kalman(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Kalman filter: means, spreads, log-likelihood."""
    run = _linear(plain, dtype)
    return over_runs(lambda y: _filtered(run(y)))


def kalman_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Rauch-Tung-Striebel smoother; the effect of inputs is in the predictions of the forward pass, which it receives."""
    run, F = _linear(plain, dtype), jnp.asarray(plain.matrices[0], dtype)

    def one(y: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        done = smcx.rts_smoother(run(y), F)
        return done.smoothed_means, _std(done.smoothed_covariances), done.marginal_loglik

    return over_runs(one)


def _linear(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    F, B, H, D = (jnp.asarray(a, dtype) for a in plain.matrices)
    mean, covariance, process, noise, inputs = _arrays(plain, dtype)
    return lambda y: smcx.kalman_filter(
        mean,
        covariance,
        F,
        process,
        H,
        noise,
        y,
        transition_input_matrix=B,
        observation_input_matrix=D,
        inputs=inputs,
    )


def extended(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The extended Kalman filter, with Jacobians by forward differentiation."""
    mean, covariance, process, noise, inputs = _arrays(plain, dtype)
    transition, observation = plain.transition, plain.observation
    moves = (transition, jax.jacfwd(transition))
    sees = (observation, jax.jacfwd(observation))
    run = lambda y: smcx.extended_kalman_filter(mean, covariance, *moves, process, *sees, noise, y, inputs=inputs)
    return over_runs(lambda y: _filtered(run(y)))


def extended_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The extended Rauch-Tung-Striebel smoother: the linear one, given the Jacobian at every filtered mean."""
    mean, covariance, process, noise, inputs = _arrays(plain, dtype)
    transition, observation = plain.transition, plain.observation
    slope = jax.jacfwd(transition)
    sees = (observation, jax.jacfwd(observation))

    def one(y: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        done = smcx.extended_kalman_filter(mean, covariance, transition, slope, process, *sees, noise, y, inputs=inputs)
        slopes = jax.vmap(slope)(done.filtered_means[:-1], inputs[1:])
        done = smcx.rts_smoother(done, slopes)
        return done.smoothed_means, _std(done.smoothed_covariances), done.marginal_loglik

    return over_runs(one)


def unscented_filter(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The unscented filter with alpha = 1, beta = 2, kappa = 0."""
    mean, covariance, process, noise, inputs = _arrays(plain, dtype)
    scaling = {"alpha": 1.0, "beta": 2.0, "kappa": 0.0}
    run = lambda y: smcx.unscented_kalman_filter(
        mean, covariance, plain.transition, process, plain.observation, noise, y, **scaling, inputs=inputs
    )
    return over_runs(lambda y: _filtered(run(y)))


def _arrays(plain: Plain, dtype: np.typing.DTypeLike) -> list[jax.Array]:
    given = (plain.mean, plain.covariance, plain.process, plain.noise, plain.inputs)
    return [jnp.asarray(a, dtype) for a in given]


def _filtered(done: Any) -> tuple[jax.Array, jax.Array, jax.Array]:
    return done.filtered_means, _std(done.filtered_covariances), done.marginal_loglik


def _std(covariances: jax.Array) -> jax.Array:
    return jnp.sqrt(jnp.diagonal(covariances, axis1=-2, axis2=-1))


def unscented(problem: SpeedAndMass, dtype: np.typing.DTypeLike) -> Callable:
    """Return a jitted function of the measured speeds (rows,) of one run or (runs, rows): means and log-likelihood."""
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
    """Return a jitted function of the key: weighted means (rows, 11) and log-likelihood.

    Measurements (rows, 2) may replace those of the problem. Input row t has the inputs of the step into t and of its measurement.
    """
    p = problem
    move, _, log_likelihood = single_track_functions(p)
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

    def run(key: jax.Array, y: jax.Array = emissions) -> tuple[jax.Array, jax.Array]:
        # A threshold above one resamples before every step.
        done = filter_(key, *functions, y, count, resampling_threshold=1.1, inputs=inputs)
        return smcx.weighted_mean(done), done.marginal_loglik

    return jax.jit(run)


def guided(plain: Plain, dtype: np.typing.DTypeLike, count: int) -> Callable:
    """The guided filter, resampled before every step, a function of measurements and keys: means and log-likelihood."""
    functions, proposal = particle_functions(plain, dtype), guide(plain, dtype)
    inputs = jnp.asarray(plain.inputs, dtype)
    start = lambda key, n, u: jax.vmap(functions.start)(jax.random.split(key, n))

    def one(y: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
        done = smcx.guided_filter(
            key,
            start,
            proposal.draw,
            proposal.log_density,
            functions.log_transition,
            functions.log_likelihood,
            y,
            count,
            resampling_threshold=1.1,
            inputs=inputs,
        )
        return smcx.weighted_mean(done), done.marginal_loglik

    return over_keys(one)


def liu_west(plain: Plain, dtype: np.typing.DTypeLike, count: int, shrinkage: float, states: int) -> Callable:
    """The filter of Liu and West: the first `states` of the problem's states move with noise, the others are parameters.

    It is a function of measurements and keys: means (rows, n) in the problem's order and log-likelihood. The look-ahead is the
    likelihood of the state that is propagated without noise.
    """
    mean, covariance, process, *_, inputs = _arrays(plain, dtype)
    spread, noise = jnp.sqrt(jnp.diag(covariance)), jnp.sqrt(jnp.diag(process))[:states]
    log_likelihood = particle_functions(plain, dtype).log_likelihood

    def start(part: slice) -> Callable:
        some, wide = mean[part], spread[part]
        return lambda key, n, *u: some + wide * jax.random.normal(key, (n, len(some)), dtype)

    def moved(x: jax.Array, parameters: jax.Array, u: jax.Array) -> jax.Array:
        return plain.transition(jnp.concatenate([x, parameters]), u)

    def one(y: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
        done = smcx.liu_west_filter(
            key,
            start(slice(states)),
            lambda key, x, p, u: moved(x, p, u)[:states] + noise * jax.random.normal(key, (states,), dtype),
            lambda y, x, p, u: log_likelihood(y, jnp.concatenate([x, p]), u),
            lambda y, x, p, u: log_likelihood(y, moved(x, p, u), u),
            start(slice(states, None)),
            y,
            count,
            shrinkage=shrinkage,
            resampling_threshold=1.1,
            parameter_moves="always",
            inputs=inputs,
        )
        means = jnp.concatenate([smcx.weighted_mean(done), smcx.param_weighted_mean(done)], axis=-1)
        return means, done.marginal_loglik

    return over_keys(one)
