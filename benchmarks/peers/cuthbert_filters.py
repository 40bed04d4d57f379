"""The Gaussian, ensemble and particle filters of `cuthbert`, jitted; its Gaussian filters are square-root filters.

In the library the first state has no measurement. In the problems it has one, which is applied with the library's own update
before its scan begins.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import cuthbert
import jax
import jax.numpy as jnp
import numpy as np
from cuthbert.ensemble_kalman import ensemble_kalman_filter
from cuthbert.gaussian import kalman as exact
from cuthbert.gaussian import moments
from cuthbert.smc import backward_sampler
from cuthbert.smc import particle_filter as smc
from cuthbertlib.ensemble_kalman import filter_update
from cuthbertlib.kalman import filtering
from cuthbertlib.linearize import linearize_moments
from cuthbertlib.resampling import multinomial, systematic
from cuthbertlib.smc.smoothing import exact_sampling

from ..problems import SingleTrack
from .jax_models import over_runs, single_track_functions
from .plain_particles import guide, over_keys, particle_functions

if TYPE_CHECKING:
    from ..plain import Plain

__all__ = [
    "backward_sampling",
    "ensemble",
    "extended",
    "extended_smoother",
    "guided",
    "kalman",
    "kalman_smoother",
    "parallel_smoother",
    "particle_filter",
]

Arrays = tuple[jax.Array, jax.Array, jax.Array]


def kalman(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Kalman filter: means, spreads, log-likelihood."""
    run, _ = _linear(plain, dtype)
    return over_runs(lambda y: _shown(*run(y, parallel=False)))


def kalman_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Rauch-Tung-Striebel smoother."""
    return _linear_smoother(plain, dtype, parallel=False)


def parallel_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """Filter and smoother in parallel over time."""
    return _linear_smoother(plain, dtype, parallel=True)


def _linear_smoother(plain: Plain, dtype: np.typing.DTypeLike, *, parallel: bool) -> Callable:
    run, backwards = _linear(plain, dtype)

    def one(y: jax.Array) -> Arrays:
        states, total = run(y, parallel=parallel)
        done = cuthbert.smoother(backwards, states, parallel=parallel)
        return done.mean, _std(done.chol_cov), total

    return over_runs(one)


def _linear(plain: Plain, dtype: np.typing.DTypeLike) -> tuple[Callable, Any]:
    F, B, H, D = (jnp.asarray(a, dtype) for a in plain.matrices)
    mean, prior, process, noise, inputs = _arrays(plain, dtype)
    move = lambda given: (F, B @ given[0], process)
    see = lambda given: (H, D @ given[0], noise, given[1])
    filter_ = exact.build_filter(mean, prior, move, see)

    def run(y: jax.Array, *, parallel: bool) -> tuple[Any, jax.Array]:
        start, first = filtering.update(mean, prior, H, D @ inputs[0], noise, y[0])
        state = exact.init_prepare(*start)
        states = cuthbert.filter(filter_, (inputs[1:], y[1:]), state, parallel=parallel)
        return states, states.log_normalizing_constant[-1] + first

    return run, exact.build_smoother(move)


def extended(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The extended Kalman filter."""
    run, _ = _extended(plain, dtype)
    return over_runs(lambda y: _shown(*run(y)))


def extended_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The extended Rauch-Tung-Striebel smoother."""
    run, backwards = _extended(plain, dtype)

    def one(y: jax.Array) -> Arrays:
        states, total = run(y)
        done = cuthbert.smoother(backwards, states)
        return done.mean, _std(done.chol_cov), total

    return over_runs(one)


def _extended(plain: Plain, dtype: np.typing.DTypeLike) -> tuple[Callable, Any]:
    mean, prior, process, noise, inputs = _arrays(plain, dtype)
    move = lambda state, given: (lambda x: (plain.transition(x, given[0]), process), state.mean)
    see = lambda state, given: (lambda x: (plain.observation(x, given[0]), noise), state.mean, given[1])
    filter_ = moments.build_filter(mean, prior, move, see)

    def run(y: jax.Array) -> tuple[Any, jax.Array]:
        H, d, _ = linearize_moments(lambda x: (plain.observation(x, inputs[0]), noise), mean)
        start, first = filtering.update(mean, prior, H, d, noise, y[0])
        state = moments.build_filter(*start, move, see).init_prepare()
        states = cuthbert.filter(filter_, (inputs[1:], y[1:]), state)
        return states, states.log_normalizing_constant[-1] + first

    return run, moments.build_smoother(move)


def ensemble(plain: Plain, dtype: np.typing.DTypeLike, members: int) -> Callable:
    """The ensemble filter with perturbed measurements, a function of measurements and keys."""
    mean, prior, process, noise, inputs = _arrays(plain, dtype)
    draw = lambda key: jax.random.normal(key, mean.shape, dtype)
    move = lambda given: lambda x, key: plain.transition(x, given[0]) + process @ draw(key)
    see = lambda given: (lambda x: plain.observation(x, given[0]), noise, given[1])
    filter_ = ensemble_kalman_filter.build_filter(lambda key: mean + prior @ draw(key), move, see, members)

    def one(y: jax.Array, key: jax.Array) -> Arrays:
        begin, update, rest = jax.random.split(key, 3)
        state = filter_.init_prepare(key=begin)
        moved, first = filter_update(update, state.ensemble, *see((inputs[0], y[0])))
        states = cuthbert.filter(filter_, (inputs[1:], y[1:]), state._replace(ensemble=moved), key=rest)
        total = states.log_normalizing_constant[-1] + first
        return states.mean, jnp.std(states.ensemble, axis=1, ddof=1), total

    return jax.jit(lambda y, key: (one if y.ndim == 2 else jax.vmap(one))(y, key))


def particle_filter(
    problem: SingleTrack, count: int, *, auxiliary: bool = False, dtype: np.typing.DTypeLike
) -> Callable:
    """The bootstrap filter, resampled before every step, as a function of the key: weighted means (rows, 11), log-likelihood.

    Measurements (rows, 2) may replace those of the problem. There is no auxiliary filter.
    """
    if auxiliary:
        raise ValueError("cuthbert has no auxiliary particle filter")
    p = problem
    emissions = jnp.asarray(np.stack([p.yaw_rate, p.lateral_acceleration], axis=1), dtype)
    functions = single_track_functions(p)
    before = np.maximum(np.arange(p.rows) - 1, 0)
    inputs = jnp.asarray(np.stack([p.steer[before], p.speed[before], p.steer, p.speed], axis=1), dtype)
    mean, spread, noise = (jnp.asarray(a, dtype) for a in (p.prior_mean, p.prior_std, p.process_std))
    draw = lambda key: jax.random.normal(key, (11,), dtype)
    start = lambda key: mean + spread * draw(key)
    move = lambda key, x, given: functions.transition(x, given[0][0], given[0][1]) + noise * draw(key)
    weigh = lambda before, x, given: functions.log_likelihood(given[1], x, given[0][2], given[0][3])
    filter_ = smc.build_filter(start, move, weigh, count, systematic.resampling)

    def one(key: jax.Array, y: jax.Array = emissions) -> tuple[jax.Array, jax.Array]:
        return _weighted(_particles(filter_, weigh, inputs, y, key))

    return jax.jit(one)


def guided(plain: Plain, dtype: np.typing.DTypeLike, count: int) -> Callable:
    """The guided filter, resampled before every step, a function of measurements and keys: means and log-likelihood."""
    functions, proposal = particle_functions(plain, dtype), guide(plain, dtype)
    inputs = jnp.asarray(plain.inputs, dtype)
    move = lambda key, x, given: proposal.draw(key, x, given[1], given[0])
    first = lambda before, x, given: functions.log_likelihood(given[1], x, given[0])

    def weigh(before: jax.Array, x: jax.Array, given: tuple[jax.Array, jax.Array]) -> jax.Array:
        u, y = given
        ratio = functions.log_transition(x, before, u) - proposal.log_density(y, x, before, u)
        return functions.log_likelihood(y, x, u) + ratio

    filter_ = smc.build_filter(functions.start, move, weigh, count, systematic.resampling)
    return over_keys(lambda y, key: _weighted(_particles(filter_, first, inputs, y, key)))


def backward_sampling(plain: Plain, dtype: np.typing.DTypeLike, count: int, paths: int) -> Callable:
    """The bootstrap filter and paths drawn backwards through its particles, a function of measurements and keys.

    It returns means and standard deviations of the paths (rows, n), and the filter's log-likelihood.
    """
    functions, inputs = particle_functions(plain, dtype), jnp.asarray(plain.inputs, dtype)
    move = lambda key, x, given: functions.move(key, x, given[0])
    weigh = lambda before, x, given: functions.log_likelihood(given[1], x, given[0])
    filter_ = smc.build_filter(functions.start, move, weigh, count, systematic.resampling)
    # The likelihood of the later state is the same for all earlier ones, so that the transition density is enough.
    density = lambda before, x, given: functions.log_transition(x, before, given[0])
    smoother = backward_sampler.build_smoother(density, exact_sampling.simulate, multinomial.resampling, paths)

    def one(y: jax.Array, key: jax.Array) -> Arrays:
        forward, back = jax.random.split(key)
        states = _particles(filter_, weigh, inputs, y, forward)
        done = cuthbert.smoother(smoother, states, (inputs[1:], y[1:]), key=back)
        spread = jnp.std(done.particles, axis=1)
        return jnp.mean(done.particles, axis=1), spread, states.log_normalizing_constant[-1]

    return over_keys(one)


def _particles(filter_: Any, first: Callable, inputs: jax.Array, y: jax.Array, key: jax.Array) -> Any:
    """Return the states of every row; `first(None, x, (inputs, y))` weights the particles of the first row."""
    begin, rest = jax.random.split(key)
    state = filter_.init_prepare(key=begin)
    logs = jax.vmap(first, (None, 0, None))(None, state.particles, (inputs[0], y[0]))
    total = jax.nn.logsumexp(logs) - jnp.log(jnp.asarray(len(logs), logs.dtype))
    state = state._replace(log_weights=logs, log_normalizing_constant=total)
    return cuthbert.filter(filter_, (inputs[1:], y[1:]), state, key=rest)


def _weighted(states: Any) -> tuple[jax.Array, jax.Array]:
    weights = jax.nn.softmax(states.log_weights, axis=-1)
    return jnp.einsum("tn,tni->ti", weights, states.particles), states.log_normalizing_constant[-1]


def _arrays(plain: Plain, dtype: np.typing.DTypeLike) -> list[jax.Array]:
    """Return the mean, the factors of the covariances of prior, process and measurements, and the inputs."""
    factors = [np.linalg.cholesky(P) for P in (plain.covariance, plain.process, plain.noise)]
    return [jnp.asarray(a, dtype) for a in (plain.mean, *factors, plain.inputs)]


def _shown(states: Any, total: jax.Array) -> Arrays:
    return states.mean, _std(states.chol_cov), total


def _std(factors: jax.Array) -> jax.Array:
    return jnp.sqrt(jnp.sum(factors**2, axis=-1))
