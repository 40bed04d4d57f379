"""The unscented filter of `dynamax`, jitted."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, UKFHyperParams, unscented_kalman_filter

from ..problems import SpeedAndMass
from .jax_models import gaussian_arrays, speed_functions

__all__ = ["unscented"]


def unscented(problem: SpeedAndMass, dtype: np.typing.DTypeLike) -> Callable:
    """A jitted function of the measured speeds (rows,) of one run or (runs, rows): means and log-likelihood."""
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
        fields = ["filtered_means", "filtered_covariances"]
        done = unscented_kalman_filter(params, speed[:, None], scaling, arrays["inputs"], output_fields=fields)
        variances = jnp.diagonal(done.filtered_covariances, axis1=-2, axis2=-1)
        return done.filtered_means, jnp.sqrt(variances), done.marginal_loglik

    return jax.jit(lambda speed: one(speed) if speed.ndim == 1 else jax.vmap(one)(speed))
