"""The compiled part of a fit to rig data: Levenberg-Marquardt on the coefficients' own scales."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx

from jaxveh.fitting.rig_problem import RigProblem, residuals, with_jacobian


class Solved(NamedTuple):
    """Coordinates `z` (p,), `steps`, whether the solver `converged`, the Gauss-Newton matrix `information` (p, p) in z."""

    z: Any
    steps: Any
    converged: Any
    information: Any


@eqx.filter_jit
def solve(problem: RigProblem, z, max_steps: int, tolerance: float) -> Solved:
    """Least squares from the coordinates z (p,)."""
    # The pull to the start keeps the normal equations definite; QR of a Jacobian this tall takes six times as long.
    solver = optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance, linear_solver=lx.Normal(lx.Cholesky()))
    solution = optx.least_squares(residuals, solver, z, problem, max_steps=max_steps, throw=False)
    _, jacobian = with_jacobian(solution.value, problem)
    converged = solution.result == optx.RESULTS.successful
    return Solved(solution.value, solution.stats["num_steps"], converged, jacobian.T @ jacobian)


@eqx.filter_jit
def predicted(problem: RigProblem, z):
    """The channels (m, n) at the coordinates z."""
    return problem.forces(problem.filled(z))


def covariance(information, least: float = 1e-10) -> tuple[jax.Array, jax.Array]:
    """The inverse of an information matrix over its identified directions, and how many these are.

    Directions along which the data say less than `least` of what they say along the best one, each coefficient on its own
    scale, are not identified; a coefficient with a share in them of more than a tenth has the variance nan.
    """
    size = jnp.sqrt(jnp.diagonal(information))
    size = jnp.where(size > 0, size, 1.0)
    values, vectors = jnp.linalg.eigh(information / size / size[:, None])
    known = values > least * values[-1]
    inverse = (vectors * jnp.where(known, 1 / jnp.where(known, values, 1.0), 0.0)) @ vectors.T
    lost = jnp.sum(jnp.where(known, 0.0, vectors**2), axis=1) > 0.01
    spoiled = lost[:, None] | lost[None, :]
    return jnp.where(spoiled, jnp.nan, inverse / size / size[:, None]), jnp.sum(known)
