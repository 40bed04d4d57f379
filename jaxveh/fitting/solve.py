"""The core of every fit: a problem's optimum, with its derivatives by the implicit function theorem."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_at_least, check_finite, check_flags, check_kind, check_whole
from jaxveh._core.result import Result, code
from jaxveh.fitting.problem import AbstractProblem, SearchEnd, by_name, in_units
from jaxveh.fitting.result import Fit

MOST_STEPS = 200


def solve(
    problem: AbstractProblem,
    start=None,
    *,
    max_steps: int = MOST_STEPS,
    tolerance: float = 1e-8,
    standard_errors: bool = True,
) -> Fit:
    """Fit a problem: arrays in, arrays out, under `jit`, `vmap` and `grad`.

    The fit has a derivative with respect to every array of the `problem`. With F the cost, an optimum z moves by
    -(d2F/dz2)^-1 d2F/dz d(data), so no derivative goes through the search. It is valid where the search has converged.
    `start`: coordinates (n,), by default the problem's own; the optimum does not depend on it, and has no derivative with
    respect to it. `tolerance`: of the problem's solver. Without `standard_errors` they are NaN.

    **Returns** a `Fit`; its `result` states how it ended. **Raises** `InputError` for `max_steps` below one, and a `start` of
    another shape or that is not finite.
    """
    check_flags(standard_errors=standard_errors)
    check_kind("problem", problem, AbstractProblem, "fitting.pose_shooting, pose_likelihood and their like make one.")
    check_whole("max_steps", max_steps)
    check_at_least("tolerance", tolerance, 0)
    if start is not None:
        start = _coordinates(problem, start)
    # As an array, so that another tolerance does not compile another program.
    return _solve(problem, start, jnp.asarray(tolerance), max_steps=max_steps, standard_errors=standard_errors)


def _coordinates(problem: AbstractProblem, start):
    """The start as an array of the kind of the problem's own."""
    check_finite("start", start)
    own = jax.eval_shape(problem.start)
    if jnp.shape(start) != own.shape:
        raise InputError(f"start has shape {jnp.shape(start)}: must be {own.shape}, as that of problem.start() is.")
    return jnp.asarray(start, own.dtype)


@eqx.filter_jit
def _solve(problem: AbstractProblem, start, tolerance, *, max_steps: int, standard_errors: bool) -> Fit:
    start = lax.stop_gradient(problem.start() if start is None else start)
    found = conclusion(problem, start, max_steps=max_steps, tolerance=tolerance, standard_errors=standard_errors)
    return fit_at(problem, found, found.cost, found.uncertainty)


@eqx.filter_custom_jvp
def optimum(problem: AbstractProblem, start, *, max_steps: int, tolerance) -> SearchEnd:
    """The end of a search from the coordinates `start` (n,), without cost and uncertainty."""
    return problem.search(start, max_steps, tolerance)._replace(cost=None, uncertainty=None)


@optimum.def_jvp
def _of_optimum(primals, tangents, **settings):
    found = optimum(*primals, **settings)
    return found, SearchEnd(motion(primals[0], found.z, tangents[0]), None, None)


@eqx.filter_custom_jvp
def conclusion(problem: AbstractProblem, start, *, max_steps: int, tolerance, standard_errors: bool) -> SearchEnd:
    """The end of a search from the coordinates `start` (n,), with the cost there, and with the uncertainty if asked for.

    What the search knows of its end is not computed again, which halves the compilation where the cost is a filter's.
    """
    found = problem.search(start, max_steps, tolerance)
    cost, uncertainty = found.cost, found.uncertainty if standard_errors else None
    if cost is None:
        cost = problem.cost(found.z)
    if uncertainty is None and standard_errors:
        uncertainty = problem.covariance(found.z)
    return found._replace(cost=cost, uncertainty=uncertainty)


@conclusion.def_jvp
def _of_conclusion(primals, tangents, *, standard_errors, **settings):
    problem, moved = primals[0], tangents[0]
    found = conclusion(*primals, standard_errors=standard_errors, **settings)
    at = lambda problem, z: (problem.cost(z), problem.covariance(z) if standard_errors else None)
    change = motion(problem, found.z, moved)
    _, (cost, uncertainty) = eqx.filter_jvp(at, (problem, found.z), (moved, change))
    return found, SearchEnd(change, None, None, cost, uncertainty)


def motion(problem: AbstractProblem, z, moved):
    """The change (n,) of the optimum z with the tangent `moved` of the problem."""
    is_none = lambda leaf: leaf is None
    still = jax.tree.map(is_none, moved, is_leaf=is_none)
    held, free = eqx.partition(problem, still, is_leaf=is_none)
    matrix, cross = curvature(lambda z, free: eqx.combine(free, held).cost(z), z, free)
    parts = jax.tree.map(lambda row, tangent: jnp.tensordot(row, tangent, tangent.ndim), cross, moved)
    change = sum(jax.tree.leaves(parts), start=jnp.zeros_like(z))
    return -jnp.linalg.solve(matrix, change)


def curvature(cost, z, free):
    """Second derivatives of a cost of z (n,) and a tree of arrays: of z twice (n, n), and of z and each array (n, ...).

    Both from one reverse pass over one forward pass, one coordinate after another: it is compiled once. The derivative of an
    optimum in either mode needs nothing more, which keeps its compilation short.
    """

    def row(direction):
        slope = lambda z, free: jax.jvp(lambda z: cost(z, free), (z,), (direction,))[1]
        return jax.grad(slope, argnums=(0, 1))(z, free)

    return lax.map(row, jnp.eye(z.size, dtype=z.dtype))


def fit_at(problem: AbstractProblem, found: SearchEnd, cost, uncertainty: tuple[jax.Array, jax.Array] | None) -> Fit:
    """The fit that ended at these coordinates, with this cost and the problem's `covariance` as `uncertainty`, None for
    none."""
    chosen, line = problem.chosen, problem.line(found.z)
    values = in_units(chosen, line)
    unknown = jnp.full((line.size, line.size), jnp.nan, line.dtype), jnp.zeros(line.shape, bool)
    covariance, known = unknown if uncertainty is None else uncertainty
    variance = jnp.diagonal(covariance)
    known = known & (variance > 0)
    slopes = jnp.stack([p.domain.slope(value) for p, value in zip(chosen, values, strict=True)])
    std = jnp.where(known, jnp.abs(slopes) * jnp.sqrt(numerics.or_one(variance, known)), jnp.nan)
    well = found.converged & ~problem.is_failure(cost)
    finite = jnp.all(jnp.isfinite(found.z)) & jnp.isfinite(cost)
    result = jnp.where(well, code(Result.successful), code(Result.not_converged))
    return Fit(
        parameters=by_name(chosen, values),
        parameters_std=by_name(chosen, std),
        unconstrained=line,
        covariance=covariance,
        cost=cost,
        steps=found.steps,
        result=jnp.where(finite, result, code(Result.non_finite_state)),
        model=problem.model_at(found.z),
        chosen=chosen,
    )
