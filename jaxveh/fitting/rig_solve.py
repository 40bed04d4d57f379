"""The compiled part of a fit to rig data: Levenberg-Marquardt on the coefficients' own scales."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx

from jaxveh.fitting.rig_problem import PULL, RigProblem, residuals, with_jacobian


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


def covariance(information) -> tuple[jax.Array, jax.Array]:
    """The covariance (p, p) in z of an information matrix and the pull, and how many directions the data identify.

    A direction is identified where its standard error is below one step, a coefficient's own size: beyond, it is the pull's.
    """
    values, vectors = jnp.linalg.eigh(information)
    values = jnp.maximum(values, 0.0)
    return (vectors / (values + PULL**2)) @ vectors.T, jnp.sum(values > 1.0)
