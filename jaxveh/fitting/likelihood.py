"""Fits that maximise a filter's likelihood: parameters, noise levels, sensor offsets, start values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax import lax

from jaxveh._core.errors import check_flags, check_key
from jaxveh._core.parameter import Parameter, Where, pick, strong
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, Gradient, scan
from jaxveh.fitting.filter_problem import AbstractFilterProblem
from jaxveh.fitting.problem import SearchEnd, on_line, scalar_parameters
from jaxveh.fitting.recorded import as_list, spread_on_line
from jaxveh.fitting.result import Fit, raise_unfinished
from jaxveh.fitting.solve import solve
from jaxveh.statespace import StateSpace, kit

REJECTED = 1e8
"""The cost of a point where the filter fails: finite, so that the line search steps back."""


class LikelihoodProblem(AbstractFilterProblem):
    """A filter's negative log-likelihood of recordings, as a function of the chosen parameters of its model.

    `rows`: a tuple, one entry per recording; `counts` (recordings,): how many times each counts. `centre`, `spread` (p,):
    mean and standard deviation of the prior on the real line of the bijectors; infinite for no prior. `key`: for filters that
    draw particles.
    """

    key: Any
    chosen: tuple[Parameter, ...] = eqx.field(static=True)

    def cost(self, z):
        model = self.model_at(z)
        estimates = [scan(self.filter, model, part, self.key) for part in self.rows]
        each = jnp.stack([estimate.log_likelihood for estimate in estimates])
        total = self.prior_cost(z) - jnp.sum(self.counts * each)
        failed = jnp.any(jnp.stack([estimate.result != 0 for estimate in estimates])) | ~jnp.isfinite(total)
        return jnp.where(failed, REJECTED, total)

    def search(self, z, max_steps, tolerance):
        solver = optx.BFGS(rtol=tolerance, atol=tolerance)
        found = optx.minimise(_cost, solver, z, self, max_steps=max_steps, throw=False)
        converged = found.result == optx.RESULTS.successful
        return SearchEnd(found.value, found.stats["num_steps"], converged, found.state.f_info.f)

    def covariance(self, z):
        return jnp.linalg.inv(hessian(self.cost, z)), jnp.ones(z.shape, bool)

    def is_failure(self, cost):
        return cost >= REJECTED

    def units(self):
        return len(self.rows)


def hessian(cost, z):
    """Second derivatives (n, n) of a cost with a long scan, by forward mode over forward mode.

    Forward mode stores no intermediate values, where reverse mode stores all of them: for three coordinates and a filter over
    300 rows it takes a sixth of the time to run, and two thirds of the time to compile.
    """
    each = jnp.eye(z.size, dtype=z.dtype)

    def slopes(z):
        return jax.vmap(lambda direction: jax.jvp(cost, (z,), (direction,))[1])(each)

    return lax.map(lambda direction: jax.jvp(slopes, (z,), (direction,))[1], each)


def _cost(z, problem: LikelihoodProblem):
    return problem.cost(z)


def pose_likelihood(
    filter: AbstractFilter,
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    where: Where,
    *,
    prior: float | Mapping[str, float] | None = None,
    key=None,
) -> LikelihoodProblem:
    """The problem of `maximum_likelihood`, for `solve`; arguments and errors as there."""
    kit.check_told(filter, model)
    if key is not None:
        check_key("maximum_likelihood", key)
    kit.check_gradients("maximum_likelihood", filter, Gradient.on_average)
    model = strong(model)
    filter.check(model)
    rows = tuple(model.rows(recording) for recording in as_list(recordings))
    chosen = scalar_parameters(model, where)
    values = pick(model, chosen)
    centre = on_line(chosen, values)
    spread = spread_on_line(chosen, values, prior)
    return LikelihoodProblem(
        filter=filter, model=model, rows=rows, counts=jnp.ones(len(rows), centre.dtype), centre=centre, spread=spread, key=key,
        chosen=chosen,
    )  # fmt: skip


def maximum_likelihood(
    filter: AbstractFilter,
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    where: Where,
    *,
    prior: float | Mapping[str, float] | None = None,
    key=None,
    max_steps: int = 200,
    tolerance: float = 1e-6,
    standard_errors: bool = True,
    throw: bool = True,
) -> Fit:
    """Fit the leaves of `model` that `where` picks by maximising the filter's likelihood of the recordings.

    `where` is called with the StateSpace: `lambda m: (m.system.vehicle.front.B, m.measurement_noise.std.a_y)`. With `prior`
    (relative standard deviations, one number or by name) around the present values, the fit is a MAP fit. The solver is BFGS
    on the real line of each leaf's bijector. A particle filter needs a `key`, the same for every evaluation: its gradient is
    correct on average, and its value jumps where other particles are chosen. Works under `jit`, `vmap` and `grad`; see
    `solve`.

    **Returns** a `Fit` whose `model` has the new values; standard errors from the Hessian at the optimum.
    **Raises** `InputError` as `run` and `solve` do; `FilterError` if the solver does not converge, unless `throw=False`.
    """
    check_flags(standard_errors=standard_errors, throw=throw)
    problem = pose_likelihood(filter, model, recordings, where, prior=prior, key=key)
    fit = solve(problem, max_steps=max_steps, tolerance=tolerance, standard_errors=standard_errors)
    if throw:
        raise_unfinished(fit)
    return fit
