"""Fits that maximise a filter's likelihood: parameters, noise levels, sensor offsets, start values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from jaxveh._core.errors import InputError
from jaxveh._core.parameter import Where, pick, prior_spread, put, resolve
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, scan
from jaxveh.fitting.result import Fit, make_fit, raise_unfinished
from jaxveh.statespace import StateSpace

REJECTED = 1e8
"""The cost of a point where the filter fails: finite, so that the line search steps back."""


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
    """Choose the leaves of `model` that `where` picks so that the filter's likelihood of the recordings is largest.

    `where` sees the StateSpace: `lambda m: (m.system.vehicle.front.B, m.measurement_noise.std.a_y)`. With `prior` (relative
    spreads, as in `with_parameters`) around the present values, the fit is a MAP fit. BFGS on the real line of each
    leaf's bijector. With a particle filter give a `key`: the same for every evaluation, and remember that its gradient
    is biased.

    **Returns** a `Fit` whose `model` carries the new values; standard errors from the Hessian at the optimum.
    **Raises** `InputError` as `run` does; `FilterError` where the solver does not converge, unless `throw=False`.
    """
    recordings = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if not recordings:
        raise InputError("recordings: empty; give at least one recording.")
    filter.check(model)
    rows = tuple(model.rows(recording) for recording in recordings)
    parameters = resolve(model, where)
    values = pick(model, parameters)
    for p, value in zip(parameters, values, strict=True):
        if jnp.ndim(value) > 0:
            raise InputError(f"where picked {p.name}, an array of shape {jnp.shape(value)}: a fit takes scalars.")
    spreads = None if prior is None else prior_spread(parameters, values, prior)
    fit = maximise(filter, model, rows, parameters, spreads, key, max_steps, tolerance, standard_errors)
    if throw:
        raise_unfinished(fit)
    return fit


@eqx.filter_jit
def maximise(filter, model, rows, parameters, spreads, key, max_steps: int, tolerance: float, standard_errors: bool):
    """The compiled part of `maximum_likelihood`: `rows` is a tuple of rows, `spreads` None or a list on the real line."""
    start = [p.domain.inverse(value) for p, value in zip(parameters, pick(model, parameters), strict=True)]
    start, unravel = jax.flatten_util.ravel_pytree(start)
    centre = start
    spread = None if spreads is None else jax.flatten_util.ravel_pytree(spreads)[0]

    def filled(z):
        values = [p.domain.forward(value) for p, value in zip(parameters, unravel(z), strict=True)]
        return put(model, parameters, values)

    def cost(z, args):
        estimates = [scan(filter, filled(z), part, key) for part in rows]
        total = -sum(estimate.log_likelihood for estimate in estimates)
        if spread is not None:
            total = total + 0.5 * jnp.sum(((z - centre) / spread) ** 2)
        failed = jnp.any(jnp.stack([estimate.result != 0 for estimate in estimates])) | ~jnp.isfinite(total)
        return jnp.where(failed, REJECTED, total)

    solver = optx.BFGS(rtol=tolerance, atol=tolerance)
    solution = optx.minimise(cost, solver, start, max_steps=max_steps, throw=False)
    z = solution.value
    least = cost(z, None)
    if standard_errors:
        covariance = jnp.linalg.inv(jax.hessian(lambda z: cost(z, None))(z))
    else:
        covariance = jnp.full((z.size, z.size), jnp.nan, z.dtype)
    converged = (solution.result == optx.RESULTS.successful) & (least < REJECTED)
    steps = solution.stats["num_steps"]
    return make_fit(parameters, z, covariance, least, steps, converged, filled(z))
