"""The Gaussian filters and smoothers of `dynamax`, jitted."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from dynamax.generalized_gaussian_ssm import (
    EKFIntegrals,
    GHKFIntegrals,
    ParamsGGSSM,
    UKFIntegrals,
    conditional_moments_gaussian_filter,
)
from dynamax.linear_gaussian_ssm import lgssm_filter, lgssm_smoother, parallel_lgssm_smoother
from dynamax.linear_gaussian_ssm.inference import make_lgssm_params
from dynamax.nonlinear_gaussian_ssm import (
    ParamsNLGSSM,
    UKFHyperParams,
    extended_kalman_filter,
    extended_kalman_smoother,
    unscented_kalman_filter,
    unscented_kalman_smoother,
)

from ..problems import SpeedAndMass
from .jax_models import gaussian_arrays, over_runs, speed_functions

if TYPE_CHECKING:
    from ..plain import Plain

__all__ = [
    "cubature",
    "extended",
    "extended_smoother",
    "gauss_hermite",
    "iterated",
    "kalman",
    "kalman_smoother",
    "parallel_smoother",
    "unscented",
    "unscented_filter",
    "unscented_smoother",
]

FIELDS = ["filtered_means", "filtered_covariances"]


def unscented(problem: SpeedAndMass, dtype: np.typing.DTypeLike) -> Callable:
    """Return a jitted function of the measured speeds (rows,) of one run or (runs, rows): means and log-likelihood."""
    transition, observation = speed_functions(problem)
    arrays = gaussian_arrays(problem, dtype)
    params = ParamsNLGSSM(
        initial_mean=arrays["mean"],
        initial_covariance=arrays["covariance"],
        dynamics_function=transition,
        dynamics_covariance=arrays["process"],
        emission_function=observation,
        emission_covariance=arrays["measurement"],
    )
    scaling = UKFHyperParams(problem.alpha, problem.beta, problem.kappa)

    def one(speed: jax.Array) -> tuple[jax.Array, jax.Array]:
        done = unscented_kalman_filter(params, speed[:, None], scaling, arrays["inputs"], output_fields=FIELDS)
        return filtered(done)

    return jax.jit(lambda speed: one(speed) if speed.ndim == 1 else jax.vmap(one)(speed))


def kalman(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Kalman filter: means, spreads, log-likelihood."""
    params, inputs = _linear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    return over_runs(lambda y: filtered(lgssm_filter(params, y, inputs)))


def kalman_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Rauch-Tung-Striebel smoother: means, spreads, log-likelihood."""
    params, inputs = _linear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    return over_runs(lambda y: smoothed(lgssm_smoother(params, y, inputs)))


def parallel_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """Filter and smoother in parallel over time."""
    params, inputs = _linear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    return over_runs(lambda y: smoothed(parallel_lgssm_smoother(params, y, inputs)))


def extended(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The extended Kalman filter."""
    params, inputs = _nonlinear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    return over_runs(lambda y: filtered(extended_kalman_filter(params, y, inputs, output_fields=FIELDS)))


def iterated(plain: Plain, dtype: np.typing.DTypeLike, linearisations: int = 5) -> Callable:
    """The iterated filter, with the right amount of work, but too small standard deviations.

    Each pass uses the measurement again, with the result of the previous pass as the prior.
    """
    params, inputs = _nonlinear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    run = lambda y: extended_kalman_filter(params, y, inputs, linearisations, output_fields=FIELDS)
    return over_runs(lambda y: filtered(run(y)))


def extended_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The extended Rauch-Tung-Striebel smoother."""
    params, inputs = _nonlinear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    return over_runs(lambda y: smoothed(extended_kalman_smoother(params, y, inputs=inputs)))


def unscented_filter(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The unscented filter with alpha = 1, beta = 2, kappa = 0."""
    params, inputs = _nonlinear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    scaling = UKFHyperParams(1.0, 2.0, 0.0)
    return over_runs(lambda y: filtered(unscented_kalman_filter(params, y, scaling, inputs, output_fields=FIELDS)))


def unscented_smoother(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The unscented smoother with the same weights."""
    params, inputs = _nonlinear(plain, dtype), jnp.asarray(plain.inputs, dtype)
    scaling = UKFHyperParams(1.0, 2.0, 0.0)
    return over_runs(lambda y: smoothed(unscented_kalman_smoother(params, y, scaling, inputs)))


def cubature(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The cubature filter: unscented points without a weight on the central one."""
    return _by_integrals(plain, dtype, UKFIntegrals(1.0, 0.0, 0.0))


def gauss_hermite(plain: Plain, dtype: np.typing.DTypeLike) -> Callable:
    """The Gauss-Hermite filter with three points per axis."""
    return _by_integrals(plain, dtype, GHKFIntegrals(3))


def _by_integrals(plain: Plain, dtype: np.typing.DTypeLike, integrals: EKFIntegrals | UKFIntegrals | GHKFIntegrals):
    arrays = [jnp.asarray(a, dtype) for a in (plain.mean, plain.covariance, plain.process, plain.noise, plain.inputs)]
    mean, covariance, process, noise, inputs = arrays
    params = ParamsGGSSM(
        initial_mean=mean,
        initial_covariance=covariance,
        dynamics_function=plain.transition,
        dynamics_covariance=process,
        emission_mean_function=plain.observation,
        emission_cov_function=lambda x, u: noise,
    )
    return over_runs(lambda y: filtered(conditional_moments_gaussian_filter(params, integrals, y, inputs)))


def _linear(plain: Plain, dtype: np.typing.DTypeLike) -> Any:
    F, B, H, D = (jnp.asarray(a, dtype) for a in plain.matrices)
    mean, covariance, process, noise = (
        jnp.asarray(a, dtype) for a in (plain.mean, plain.covariance, plain.process, plain.noise)
    )
    return make_lgssm_params(
        mean,
        covariance,
        F,
        process,
        H,
        noise,
        dynamics_bias=jnp.zeros(len(mean), dtype),
        dynamics_input_weights=B,
        emissions_bias=jnp.zeros(len(noise), dtype),
        emissions_input_weights=D,
    )


def _nonlinear(plain: Plain, dtype: np.typing.DTypeLike) -> Any:
    mean, covariance, process, noise = (
        jnp.asarray(a, dtype) for a in (plain.mean, plain.covariance, plain.process, plain.noise)
    )
    return ParamsNLGSSM(
        initial_mean=mean,
        initial_covariance=covariance,
        dynamics_function=plain.transition,
        dynamics_covariance=process,
        emission_function=plain.observation,
        emission_covariance=noise,
    )


def filtered(done: Any) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return means, standard deviations and log-likelihood of a filter's posterior."""
    return done.filtered_means, _std(done.filtered_covariances), done.marginal_loglik


def smoothed(done: Any) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return means, standard deviations and log-likelihood of a smoother's posterior."""
    return done.smoothed_means, _std(done.smoothed_covariances), done.marginal_loglik


def _std(covariances: jax.Array) -> jax.Array:
    return jnp.sqrt(jnp.diagonal(covariances, axis1=-2, axis2=-1))
