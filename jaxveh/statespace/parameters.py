"""Chosen parameters as states: they are removed from the model and estimated as part of the state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.bijectors import AbstractBijector
from jaxveh._core.errors import InputError, check, check_kind, check_single, did_you_mean, is_concrete
from jaxveh._core.names import as_mapping, record_type
from jaxveh._core.parameter import Parameter, Where, check_shares, pick, prior_spread, put, resolve, share_of
from jaxveh._core.parameters import Parameters
from jaxveh.statespace.dependent_noise import around
from jaxveh.statespace.independent import Independent
from jaxveh.statespace.model import Prior, StateSpace, check_model
from jaxveh.statespace.noise import Gaussian
from jaxveh.statespace.process import Continuous, join


class Chosen(eqx.Module):
    """The fields of a joint state that are the model's own, and those that are parameters (on the real line; their paths
    start at the system)."""

    states: tuple[str, ...] = eqx.field(static=True)
    parameters: tuple[Parameter, ...] = eqx.field(static=True)
    state_type: Any = eqx.field(static=True)

    @property
    def joint_type(self):
        """The joint state's NamedTuple class."""
        return record_type("State", (*self.states, *[p.field for p in self.parameters]))

    def split(self, x):
        """The model's own state, and the parameters on the real line in a list."""
        n = len(self.states)
        return self.state_type(*x[:n]), list(x[n:])

    def join(self, state, unconstrained):
        """The joint state."""
        return self.joint_type(*state, *unconstrained)

    def physical(self, unconstrained) -> list:
        """The parameters in physical units."""
        return [p.domain.forward(value) for p, value in zip(self.parameters, unconstrained, strict=True)]

    def fill(self, system, unconstrained):
        """The system with its missing leaves put back."""
        return put(system, self.parameters, self.physical(unconstrained))

    def of_report(self, report) -> Parameters:
        """The parameters' entries of a report, by name."""
        return Parameters({p.name: getattr(report, p.field) for p in self.parameters})


class JointTransition(eqx.Module):
    """Moves the model's own state with the parameters of the joint state; the parameters stay."""

    function: Callable = eqx.field(static=True)
    chosen: Chosen = eqx.field(static=True)

    def __call__(self, system, t0, t1, x, u):
        state, unconstrained = self.chosen.split(x)
        state = self.function(self.chosen.fill(system, unconstrained), t0, t1, state, u)
        return self.chosen.join(state, unconstrained)


class JointObservation(eqx.Module):
    """Observes the model's own state, or gives its noise law, with the parameters of the joint state."""

    function: Callable = eqx.field(static=True)
    chosen: Chosen = eqx.field(static=True)

    def __call__(self, system, t, x, u):
        state, unconstrained = self.chosen.split(x)
        return self.function(self.chosen.fill(system, unconstrained), t, state, u)


class JointReport(eqx.Module):
    """The model's own report followed by the parameters in physical units."""

    function: Callable | None = eqx.field(static=True)
    chosen: Chosen = eqx.field(static=True)

    def __call__(self, system, t, x, u):
        state, unconstrained = self.chosen.split(x)
        own = state if self.function is None else self.function(self.chosen.fill(system, unconstrained), t, state, u)
        physical = self.chosen.physical(unconstrained)
        names = (*own._fields, *[p.field for p in self.chosen.parameters])
        return record_type("Report", names)(*own, *physical)


def with_parameters(
    model: StateSpace,
    where: Where,
    prior: float | Mapping[str, float],
    walk: float | Mapping[str, float] = 0.0,
    domain: AbstractBijector | None = None,
) -> StateSpace:
    """The model with the leaves of its system that `where` picks turned into states.

    The leaves are removed from `model.system` and become the prior's mean, so that a gradient is never silently zero: it
    reaches the start values as `model.prior.mean`. Each parameter walks on the real line of its own bijector.

    **Arguments**: `where` is called with the StateSpace, `lambda m: m.system.vehicle.front.B`. `prior`: the relative standard
    deviation, one number or by name (`{"B": 0.1, "rear.D": 0.05}`); for a positive parameter it is that of its logarithm, for
    an unbounded one a multiple of its declared scale. `walk`: the random walk's standard deviation, relative in the same way,
    per root second (zero: the parameters are constant and carry no process noise). `domain` overrides every parameter's own
    bijector (`Real()`: an additive walk in physical units, as in papers; standard deviations are then relative to the value
    or scale).

    **Raises** `InputError` if a standard deviation is zero or negative, or if `where` picks no leaf of the system.
    """
    check_model("with_parameters", model)
    if model.chosen is not None:
        raise InputError("with_parameters: this model estimates parameters already; choose them all in one `where`.")
    parameters = tuple(_of_system(p) for p in resolve(model, where))
    if domain is not None:
        check_kind("domain", domain, AbstractBijector, "Take one of jaxveh.kit, such as Real() (called), or None.")
        parameters = tuple(p._replace(domain=domain) for p in parameters)
    values = pick(model.system, parameters)
    shaped = [p.name for p, value in zip(parameters, values, strict=True) if jnp.ndim(value) > 0]
    if shaped:
        raise InputError(f"where picked {shaped[0]}, an array: parameters that are states must be scalars.")
    chosen = Chosen(model.states, parameters, type(model.prior.mean))
    starts = [p.domain.inverse(value) for p, value in zip(parameters, values, strict=True)]
    spreads = dict(zip([p.field for p in parameters], prior_spread(parameters, values, prior), strict=True))
    own = model.prior.law
    law = (
        Gaussian({**own.std._asdict(), **spreads})
        if isinstance(own, Gaussian)
        else Independent((own, Gaussian(spreads)))
    )
    return StateSpace(
        system=put(model.system, parameters, [None] * len(parameters)),
        transition=JointTransition(model.transition_function, chosen),
        observation=JointObservation(model.observation_function, chosen),
        report=JointReport(model.report_function, chosen),
        process_noise=join(model.process_noise, _walk(parameters, values, walk)),
        measurement_noise=around(model.measurement_noise, lambda law: JointObservation(law, chosen)),
        prior=Prior(chosen.joint_type(*model.prior.mean, *starts), law),
        inputs=model.inputs,
        angles=model.angles,
        input_path=model.input_path,
        chosen=chosen,
    )


def _of_system(p: Parameter) -> Parameter:
    """The parameter with its path relative to the system."""
    whole, _, path = p.path.partition(".")
    if whole != "system" or not path:
        raise InputError(
            f"with_parameters: where picked {p.path}: it must pick leaves of `m.system...`. Noise levels are for "
            "`fitting.maximum_likelihood`."
        )
    return p._replace(path=path)


def _walk(parameters, values, relative):
    """The walk's noise, or None; zero, or no entry in a mapping, means a constant."""
    check_shares("walk", parameters, relative)
    if not isinstance(relative, Mapping):
        check("walk", relative, lambda _: True, "a relative standard deviation, or a mapping from names to them")
    shares = [share_of(p, relative) if isinstance(relative, Mapping) else relative for p in parameters]
    still = [share is None or (is_concrete(share) and share == 0) for share in shares]
    walking = [
        (p, prior_spread((p,), [value], share, "walk")[0])
        for p, value, share, rests in zip(parameters, values, shares, still, strict=True)
        if not rests
    ]
    return Continuous(Gaussian({p.field: spread for p, spread in walking})) if walking else None


def start_from(model: StateSpace, **physical) -> StateSpace:
    """The same model with other prior means, given in physical units by field (`front_B=9.0`, `v_y=0.1`)."""
    check_model("start_from", model)
    by_field = {} if model.chosen is None else {p.field: p for p in model.chosen.parameters}
    unknown = [name for name in physical if name not in model.states]
    if unknown:
        there, guess = ", ".join(model.states), did_you_mean(unknown, model.states)
        raise InputError(f"start_from: unknown state(s) {', '.join(unknown)}; there are: {there}.{guess}")
    new = {}
    for name, value in physical.items():
        check_single(**{f"start_from: {name}": value})
        like = getattr(model.prior.mean, name)
        value = jnp.asarray(value, like.dtype)
        new[name] = by_field[name].domain.inverse(value) if name in by_field else value
    return eqx.tree_at(lambda m: m.prior.mean, model, model.prior.mean._replace(**new))


def parameters_of(model: StateSpace, report) -> Parameters | None:
    """The parameters of a report (a state's, a mean's or a std's), by name: `.front.B`; None for a model without parameters."""
    check_model("parameters_of", model)
    return None if model.chosen is None else model.chosen.of_report(report)


def put_parameters(model: StateSpace, report) -> Any:
    """The system with the parameters of one report (physical scalars) put back: an ordinary car again.

    `report`: a NamedTuple or a mapping by field (`front_B`). **Raises** `InputError` if it lacks a parameter.
    """
    check_model("put_parameters", model)
    if model.chosen is None:
        return model.system
    given, fields = as_mapping(report, "put_parameters: report"), [p.field for p in model.chosen.parameters]
    missing = [field for field in fields if field not in given]
    if missing:
        raise InputError(
            f"put_parameters: report has {', '.join(map(str, given)) or 'no fields'}: must have {', '.join(missing)}, too: the "
            f"parameters of this model are {', '.join(fields)}."
        )
    return put(model.system, model.chosen.parameters, [given[field] for field in fields])
