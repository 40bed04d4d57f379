"""What a fit returns: parameters by name with standard errors, and the model that carries them."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import FilterError, is_concrete
from jaxveh._core.names import record
from jaxveh._core.parameter import Parameter
from jaxveh._core.result import Result, code


class Fit(eqx.Module):
    """A fit of chosen parameters.

    `mean`, `std`: NamedTuples by field (`front_B`), physical units, standard errors by Laplace's approximation (the
    curvature at the optimum, mapped through each bijector's slope; NaN where the curvature is not positive definite).
    `unconstrained` (p,) and `covariance` (p, p): the same on the real line. `cost`: the minimised negative
    log-posterior, up to a constant. `steps`: taken by the solver. `result`: code, see `jaxveh.Result`. `model`: the
    StateSpace with the fitted values in place.
    """

    mean: Any
    std: Any
    unconstrained: jax.Array
    covariance: jax.Array
    cost: jax.Array
    steps: jax.Array
    result: jax.Array
    model: Any
    parameters: tuple[Parameter, ...] = eqx.field(static=True)


def make_fit(parameters: tuple[Parameter, ...], unconstrained, covariance, cost, steps, converged, model) -> Fit:
    """A Fit from the optimum on the real line."""
    physical = [p.domain.forward(z) for p, z in zip(parameters, unconstrained, strict=True)]
    slopes = [p.domain.slope(value) for p, value in zip(parameters, physical, strict=True)]
    variances = jnp.diagonal(covariance)
    spread = jnp.where(variances > 0, jnp.sqrt(jnp.where(variances > 0, variances, 1)), jnp.nan)
    finite = jnp.all(jnp.isfinite(unconstrained)) & jnp.isfinite(cost)
    result = jnp.where(converged, code(Result.successful), code(Result.not_converged))
    result = jnp.where(finite, result, code(Result.non_finite_state))
    fields = [p.field for p in parameters]
    return Fit(
        mean=record("Parameters", dict(zip(fields, physical, strict=True))),
        std=record("Parameters", {f: s * d for f, s, d in zip(fields, slopes, spread, strict=True)}),
        unconstrained=unconstrained,
        covariance=covariance,
        cost=cost,
        steps=steps,
        result=result,
        model=model,
        parameters=parameters,
    )


def raise_unfinished(fit: Fit) -> None:
    """Raise `FilterError` where the fit did not end well; tracers pass."""
    if is_concrete(fit.result) and int(fit.result) != 0:
        names = ", ".join(p.name for p in fit.parameters)
        reason = Result(int(fit.result)).message
        raise FilterError(
            f"fit of {names} stopped after {int(fit.steps)} steps: {reason}. throw=False returns it as it is."
        )
