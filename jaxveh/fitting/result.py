"""What a fit returns: fitted parameters with standard errors, in one shape whatever was fitted."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

from typing import Any

import equinox as eqx
import jax

from jaxveh._core.errors import FilterError, is_concrete
from jaxveh._core.parameter import Parameter
from jaxveh._core.result import Result


class AbstractFit(eqx.Module):
    """What all fits return.

    `values`, `std`: the fitted parameters in physical units and their standard errors, in the shape of what `where` picked
    (without a `where`: an array (p,) in the order of `names`; of a model whose parameters are states, a tree as
    `Estimate.parameters`); NaN for a standard error that the data do not give. `unconstrained` (p,), `covariance` (p, p): the
    same on the line of each parameter's bijector. `cost`: the minimised negative log-posterior, up to a constant. `steps`: taken
    by the solver. `result`: a code, see `jaxveh.Result`. `model`: what was fitted, with the values in place.
    """

    values: eqx.AbstractVar[Any]
    std: eqx.AbstractVar[Any]
    unconstrained: eqx.AbstractVar[Any]
    covariance: eqx.AbstractVar[Any]
    cost: eqx.AbstractVar[Any]
    steps: eqx.AbstractVar[Any]
    result: eqx.AbstractVar[Any]
    model: eqx.AbstractVar[Any]
    parameters: eqx.AbstractVar[tuple[Parameter, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, (p,)."""
        return tuple(p.name for p in self.parameters)

    @property
    def converged(self):
        """Whether the fit ended well: a truth value, or one a fit of a batch."""
        return self.result == 0

    @property
    def reason(self) -> str:
        """Why the fit ended, in words; for one fit, outside jit."""
        return Result(int(self.result)).message


class Fit(AbstractFit):
    """A fit by `multiple_shooting`, `maximum_likelihood`, `prediction_error`, or by `solve` of any problem; see `AbstractFit`."""

    values: Any
    std: Any
    unconstrained: jax.Array
    covariance: jax.Array
    cost: jax.Array
    steps: jax.Array
    result: jax.Array
    model: Any
    parameters: tuple[Parameter, ...] = eqx.field(static=True)


def raise_unfinished(fit: AbstractFit) -> None:
    """Raise `FilterError` where the fit did not end well; tracers pass."""
    if is_concrete(fit.result) and int(fit.result) != 0:
        raise FilterError(
            f"fit of {', '.join(fit.names)} stopped after {int(fit.steps)} steps: {fit.reason}. "
            "throw=False returns it as it is."
        )
