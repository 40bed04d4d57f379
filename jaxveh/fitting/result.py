"""The result of a fit: fitted parameters with standard errors, in the same form for every fit."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

import dataclasses
from typing import Any, ClassVar, Self

import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np

from jaxveh._core import bijectors
from jaxveh._core.errors import FilterError, InputError, is_concrete
from jaxveh._core.labelled import PARAMETER, Labelled, Variable, make_again, run_axes
from jaxveh._core.overview import Lazy, Overview, count_of, is_known, number
from jaxveh._core.packing import Packing, unpack
from jaxveh._core.parameter import Parameter
from jaxveh._core.parameters import Parameters
from jaxveh._core.result import Result
from jaxveh._core.shown import Kept

OTHER = f"{PARAMETER}_2"
"""The second dimension of a covariance."""


class AbstractFit(Kept, eqx.Module):
    """The base class of all fits' results.

    `parameters`, `parameters_std`: the fitted parameters in physical units and their standard errors, `Parameters` as those
    of an `Estimate` (`.front.B`, `["front.B"]`); a standard error that the data do not determine is NaN. `unconstrained`
    (p,), `covariance` (p, p): the same on the real line of each parameter's bijector. `cost`: the minimised negative
    log-posterior, up to a constant. `steps`: the solver's number of steps. `result`: a code, see `jaxveh.Result`. `model`:
    the model with the fitted values. `chosen`: the descriptions of the parameters (unit, domain), in their order.

    `save`, `load`, `to_xarray` and `from_xarray` keep all but the functions of the `model`. A loaded fit has a dict of the
    model's numbers by their paths; `Fit.load(path).with_model(start)` puts them into a model of the same structure.
    """

    drawn_by = "fit"
    kept_fields: ClassVar[tuple[str, ...]] = ()
    """Fields of a subclass that are also kept."""

    parameters: eqx.AbstractVar[Parameters]
    parameters_std: eqx.AbstractVar[Parameters]
    unconstrained: eqx.AbstractVar[Any]
    covariance: eqx.AbstractVar[Any]
    cost: eqx.AbstractVar[Any]
    steps: eqx.AbstractVar[Any]
    result: eqx.AbstractVar[Any]
    model: eqx.AbstractVar[Any]
    chosen: eqx.AbstractVar[tuple[Parameter, ...]]

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame` with a row per parameter: `parameter`, `unit`, `value` and its standard error `std`; for a batch
        of fits also a column `run`."""
        return super().to_pandas()

    def with_model(self, model: Any) -> Self:
        """The same fit, with the numbers of the fitted model put into a `model` of the same structure, such as the start.

        **Raises** `InputError` if the model has other array leaves, or leaves of other shapes.
        """
        numbers, (paths, structure) = _numbers_of(self.model), jtu.tree_flatten_with_path(model)
        there = {jtu.keystr(path): np.shape(leaf) for path, leaf in paths if _is_number(leaf)}
        kept = {path: np.shape(value) for path, value in numbers.items()}
        if there != kept:
            lost = sorted(set(kept) ^ set(there)) or [path for path in kept if kept[path] != there[path]]
            raise InputError(
                f"with_model: {', '.join(lost[:5])} differ between the fitted model and this one: must be of one structure."
            )
        leaves = [numbers.get(jtu.keystr(path), leaf) for path, leaf in paths]
        return dataclasses.replace(self, model=jtu.tree_unflatten(structure, leaves))

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, (p,)."""
        return tuple(p.name for p in self.chosen)

    @property
    def converged(self):
        """Whether the fit ended well: a truth value, or one per fit of a batch."""
        return self.result == 0

    def _labelled(self) -> Labelled:
        lead, packing = run_axes(np.ndim(self.cost)), Packing()
        plans = {"parameters": packing.add(self.parameters, "value", lead)}
        plans["parameters_std"] = packing.add(self.parameters_std, "std", lead)
        packing.coordinates[PARAMETER] = Variable((PARAMETER,), np.array(self.names, object))
        packing.coordinates["unit"] = Variable((PARAMETER,), np.array([p.unit for p in self.chosen], object))
        for name, dims in (("unconstrained", (PARAMETER,)), ("covariance", (PARAMETER, OTHER))):
            plans[name] = packing.add(getattr(self, name), name, (*lead, *dims))
        for name in ("cost", "steps", "result", *self.kept_fields):
            plans[name] = packing.add(getattr(self, name), name, lead)
        plans["model"] = packing.add(_numbers_of(self.model), "model", (), inside="model")
        facts = {"plans": plans, "chosen": [_told(p) for p in self.chosen]}
        return Labelled(
            type(self).__name__,
            packing.variables,
            packing.coordinates,
            ("value", "std"),
            "",
            {**facts, **self._facts()},
        )

    def _facts(self) -> dict[str, Any]:
        """Values of a subclass other than arrays that are kept."""
        return {}

    @classmethod
    def _of_facts(cls, facts: dict[str, Any]) -> dict[str, Any]:
        """The fields that `_facts` returned."""
        return {}

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Self:
        plans = labelled.facts["plans"]
        names = [field.name for field in dataclasses.fields(cls)]
        fields = {name: unpack(plans.get(name), labelled.both) for name in names}
        fields["chosen"] = tuple(_parameter(told) for told in labelled.facts["chosen"])
        return make_again(cls, {**fields, **cls._of_facts(labelled.facts)})

    def _overview(self) -> Overview:
        title = f"{type(self).__name__}: {count_of(len(self.chosen), 'parameter')}{self._ended()}"
        value, std = self.parameters, self.parameters_std
        row = lambda p: (p.name, number(value[p.name]), number(std[p.name]), p.unit)
        return Overview(title, ("parameter", "value", "std", "unit"), Lazy(self.chosen, row))

    def _ended(self) -> str:
        """How the fit ended, in words."""
        if not is_known(self.result):
            return ""
        if np.ndim(self.result):
            well = int(np.sum(np.asarray(self.result) == 0))
            return f", {count_of(np.size(self.result), 'fit')}, of which {well} converged"
        went = "converged" if int(self.result) == 0 else f"not converged ({self.reason})"
        return f", {went} after {count_of(int(self.steps), 'step')}, cost {number(self.cost)}"

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
    """Raise `FilterError` if the fit did not end well; tracers pass."""
    if is_concrete(fit.result) and int(fit.result) != 0:
        raise FilterError(
            f"fit of {', '.join(fit.names)} stopped after {int(fit.steps)} steps: {fit.reason}. "
            "throw=False returns the unfinished fit."
        )


def _is_number(leaf: Any) -> bool:
    return eqx.is_array(leaf) and not jax.numpy.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _numbers_of(model: Any) -> dict[str, Any]:
    """The array leaves of a model by their path; the model of a loaded fit is already this dict."""
    if isinstance(model, dict):
        return model
    return {jtu.keystr(path): leaf for path, leaf in jtu.tree_flatten_with_path(model)[0] if _is_number(leaf)}


def _told(p: Parameter) -> dict[str, Any]:
    """A parameter as plain values."""
    domain = {field.name: float(getattr(p.domain, field.name)) for field in dataclasses.fields(p.domain)}
    return {**p._asdict(), "domain": [type(p.domain).__name__, domain]}


def _parameter(told: dict[str, Any]) -> Parameter:
    """The parameter from its plain values. **Raises** `InputError` for a user's own domain."""
    name, fields = told["domain"]
    kind = {kind.__name__: kind for kind in (bijectors.Real, bijectors.Positive, bijectors.Interval)}.get(name)
    if kind is None:
        raise InputError(f"{told['name']} has the domain {name}, which is not of this package.")
    return Parameter(**{**told, "domain": kind(**fields)})
