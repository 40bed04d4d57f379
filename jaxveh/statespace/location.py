"""The information of noise laws about a shift: the Fisher information of location."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh.statespace.independent import Independent
from jaxveh.statespace.noise import AbstractNoise, Gaussian, MultivariateGaussian, StudentT


def location_covariance(law: AbstractNoise) -> jax.Array:
    """(k, k) inverse of the Fisher information of the law's location, in the order of its names.

    It is the covariance of a Gaussian, and scale^2 (dof + 3) / (dof + 1) for Student's t, which exists for every dof and is
    less than the variance: heavy tails with a sharp middle hold more information than a Gaussian of the same standard
    deviation.

    **Raises** `InputError` for other laws.
    """
    if isinstance(law, Independent):
        return jax.scipy.linalg.block_diag(*[location_covariance(part) for part in law.laws])
    if isinstance(law, (Gaussian, MultivariateGaussian)):
        return law.covariance()
    if isinstance(law, StudentT):
        return jnp.diag(jnp.stack([scale**2 for scale in law.scale]) * (law.dof + 3) / (law.dof + 1))
    raise InputError(
        f"{type(law).__name__}: its Fisher information is not known here; must be Gaussian, MultivariateGaussian, StudentT or "
        "several of these."
    )
