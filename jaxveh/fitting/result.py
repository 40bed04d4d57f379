"""What a fit returns: fitted parameters with standard errors, in one shape whatever was fitted."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

from typing import Any

import equinox as eqx
import jax

from jaxveh._core.errors import FilterError, is_concrete
from jaxveh._core.parameter import Parameter
from jaxveh._core.parameters import Parameters
from jaxveh._core.result import Result


class AbstractFit(eqx.Module):
    """What all fits return.

    `parameters`, `parameters_std`: the fitted parameters in physical units and their standard errors, `Parameters` as those of an
    `Estimate` (`.front.B`, `["front.B"]`); NaN for a standard error that the data do not give. `unconstrained` (p,), `covariance`
    (p, p): the same on the line of each parameter's bijector. `cost`: the minimised negative log-posterior, up to a constant.
    `steps`: taken by the solver. `result`: a code, see `jaxveh.Result`. `model`: what was fitted, with the values in place.
    `chosen`: what the parameters are (unit, domain), in their order.
    """

    parameters: eqx.AbstractVar[Parameters]
    parameters_std: eqx.AbstractVar[Parameters]
    unconstrained: eqx.AbstractVar[Any]
    covariance: eqx.AbstractVar[Any]
    cost: eqx.AbstractVar[Any]
    steps: eqx.AbstractVar[Any]
    result: eqx.AbstractVar[Any]
    model: eqx.AbstractVar[Any]
    chosen: eqx.AbstractVar[tuple[Parameter, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, (p,)."""
        return tuple(p.name for p in self.chosen)

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

    parameters: Parameters
    parameters_std: Parameters
    unconstrained: jax.Array
    covariance: jax.Array
    cost: jax.Array
    steps: jax.Array
    result: jax.Array
    model: Any
    chosen: tuple[Parameter, ...] = eqx.field(static=True)


def raise_unfinished(fit: AbstractFit) -> None:
    """Raise `FilterError` where the fit did not end well; tracers pass."""
    if is_concrete(fit.result) and int(fit.result) != 0:
        raise FilterError(
            f"fit of {', '.join(fit.names)} stopped after {int(fit.steps)} steps: {fit.reason}. "
            "throw=False returns it as it is."
        )
