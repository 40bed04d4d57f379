"""The definition of a fit: a cost over coordinates, the search for its optimum, and the parameters at the optimum."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.parameter import Parameter, Where, pick, resolve
from jaxveh._core.parameters import Parameters


class SearchEnd(NamedTuple):
    """The end of a search: the coordinates `z` (n,), the number of `steps`, and whether it `converged`.

    `cost`, `uncertainty`: those of the problem at z (`AbstractProblem.cost`, `covariance`), where the search knows them.
    """

    z: Any
    steps: Any
    converged: Any
    cost: Any = None
    uncertainty: tuple[Any, Any] | None = None


class AbstractProblem(eqx.Module):
    """A cost to be minimised: the negative log-posterior of the parameters `chosen`, given data.

    Everything that the optimum depends on is an array leaf (data, noise levels, prior spreads), so that `solve` has a
    derivative with respect to each. The coordinates z (n,) are the solver's: the parameters, on a scale of its own, and any
    other unknowns. On the real line of their bijectors the parameters are an array (p,).
    """

    chosen: eqx.AbstractVar[tuple[Parameter, ...]]

    @abc.abstractmethod
    def start(self) -> jax.Array:
        """The coordinates (n,) from which the search starts."""

    @abc.abstractmethod
    def cost(self, z):
        """The negative log-posterior at the coordinates z (n,), up to a constant: a scalar."""

    @abc.abstractmethod
    def search(self, z, max_steps: int, tolerance) -> SearchEnd:
        """The end of a search for the least cost from the coordinates z (n,), by a solver of optimistix."""

    @abc.abstractmethod
    def line(self, z) -> jax.Array:
        """The parameters (p,) on the real line of their bijectors."""

    @abc.abstractmethod
    def covariance(self, z) -> tuple[jax.Array, jax.Array]:
        """The covariance (p, p) of the parameters on their real line at an optimum, and which of them (p,) the data
        determine."""

    @abc.abstractmethod
    def model_at(self, z) -> Any:
        """The model with the parameters at z in place."""

    @abc.abstractmethod
    def is_failure(self, cost) -> Any:
        """Whether this cost is not that of an optimum, such as a diverged simulation's."""

    @abc.abstractmethod
    def units(self) -> int:
        """The number of parts of the data that can be resampled one by one: rows of rig data, recordings."""

    @abc.abstractmethod
    def with_counts(self, counts) -> "AbstractProblem":
        """The problem in which each part of the data counts the given number of times, (units,)."""


def by_name(chosen: tuple[Parameter, ...], values) -> Parameters:
    """Values (p, ...) by their parameters' names."""
    return Parameters({p.name: value for p, value in zip(chosen, values, strict=True)})


def scalar_parameters(model: Any, where: Where) -> tuple[Parameter, ...]:
    """The scalar parameters that `where` picks from a model.

    **Raises** `InputError` as `resolve` does, for arrays, and for None.
    """
    if where is None:
        raise InputError("where = None: must be a function, such as lambda model: model.system.vehicle.front.B.")
    chosen = resolve(model, where)
    for p, value in zip(chosen, pick(model, chosen), strict=True):
        if jnp.ndim(value) > 0:
            raise InputError(f"where picked {p.name}, an array of shape {jnp.shape(value)}: a fit takes scalars.")
    return chosen


def on_line(chosen: tuple[Parameter, ...], physical) -> jax.Array:
    """Physical values on the real line of their bijectors, (p,)."""
    return jnp.stack([p.domain.inverse(value) for p, value in zip(chosen, physical, strict=True)])


def in_units(chosen: tuple[Parameter, ...], line) -> list:
    """Values on the real line of their bijectors in physical units."""
    return [p.domain.forward(line[i]) for i, p in enumerate(chosen)]
