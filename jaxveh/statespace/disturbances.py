"""Unknown accelerations as states: external pushes on a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_positive, check_single
from jaxveh._core.names import check_names, record_type
from jaxveh.statespace.dependent_noise import around
from jaxveh.statespace.independent import combine
from jaxveh.statespace.model import Prior, StateSpace, check_model
from jaxveh.statespace.noise import Gaussian
from jaxveh.statespace.process import Continuous, join

DISTURBANCE_PREFIX = "disturbance_"
"""A disturbance's state has this prefix before the name of the state that it pushes."""


class Disturbances(eqx.Module):
    """The states that are pushed, and the channels that measure the pushes: pairs of names."""

    states: tuple[str, ...] = eqx.field(static=True)
    felt: tuple[tuple[str, str], ...] = eqx.field(static=True)

    @property
    def names(self) -> tuple[str, ...]:
        """The disturbances' own states."""
        return tuple(DISTURBANCE_PREFIX + name for name in self.states)


class AbstractDisturbed(eqx.Module):
    """One of the model's functions, for a state that is followed by the disturbances; `state_type` is the model's own."""

    function: Callable = eqx.field(static=True)
    disturbances: Disturbances = eqx.field(static=True)
    state_type: Any = eqx.field(static=True)

    def split(self, x):
        """The model's own state, and each disturbance by the state that it pushes."""
        pushed = self.disturbances.states
        n = len(x) - len(pushed)
        return self.state_type(*x[:n]), dict(zip(pushed, x[n:], strict=True))


class DisturbedTransition(AbstractDisturbed):
    """Half of the push before the model's own step and half after: exact to second order in the step."""

    def __call__(self, system, t0, t1, x, u):
        state, rates = self.split(x)
        half = 0.5 * (t1 - t0)
        push = lambda state: state._replace(**{name: getattr(state, name) + half * d for name, d in rates.items()})
        state = push(self.function(system, t0, t1, push(state), u))
        return type(x)(*state, *rates.values())


class DisturbedObservation(AbstractDisturbed):
    """The model's own observation, plus the disturbances in the channels that measure them."""

    def __call__(self, system, t, x, u):
        state, rates = self.split(x)
        found = self.function(system, t, state, u)
        for name, channel in self.disturbances.felt:
            found = found._replace(**{channel: getattr(found, channel) + rates[name]})
        return found


class DisturbedNoise(AbstractDisturbed):
    """The noise law of the model's own state: a disturbance is not a sensor's noise."""

    def __call__(self, system, t, x, u):
        return self.function(system, t, self.split(x)[0], u)


class DisturbedReport(AbstractDisturbed):
    """The model's own report followed by the disturbances."""

    def __call__(self, system, t, x, u):
        state, rates = self.split(x)
        own = self.function(system, t, state, u)
        return record_type("Report", (*own._fields, *self.disturbances.names))(*own, *rates.values())


def with_disturbances(
    model: StateSpace,
    prior: Mapping[str, float],
    walk: Mapping[str, float] | None = None,
    felt: Mapping[str, str] | None = None,
) -> StateSpace:
    """The model with an unknown, slowly changing push on chosen states: `disturbance_v_y`, in the state's unit per second.

    **Arguments**: `prior`, the standard deviation of each push at the start, by the state that it acts on, with mean zero;
    `walk`, the standard deviation of its random walk per root second, by the same names (none: constant, as in observers; a
    Kalman filter then stops following it); `felt`, channels to which a push adds, by the state (`{"v_y": "a_y"}`: an
    accelerometer measures a crosswind, but not gravity on a banked road).

    The push always acts, also below the speed at which a car's states are held: there it still moves them.

    **Raises** `InputError` for names that are no states or channels, and standard deviations that are not positive.
    """
    check_model("with_disturbances", model)
    walk, felt = dict(walk or {}), dict(felt or {})
    if not prior:
        raise InputError("with_disturbances: prior is empty; name at least one state that is pushed.")
    check_names("prior", prior, model.states)
    check_names("walk", walk, prior)
    check_names("felt", felt, prior)
    check_names("felt", felt.values(), model.channels)
    for what, spreads in (("prior", prior), ("walk", walk)):
        for name, value in spreads.items():
            check_single(**{f"with_disturbances: {what} of {name}": value})
            check_positive(f"{what} of {name}", value, "the state's unit per second")
    disturbances = Disturbances(tuple(prior), tuple(felt.items()))
    kind, dtype = type(model.prior.mean), model.dtype
    scalar = lambda value: jnp.asarray(value, dtype)
    joint = record_type("State", (*model.states, *disturbances.names))
    law = combine(
        model.prior.law, Gaussian({DISTURBANCE_PREFIX + name: scalar(value) for name, value in prior.items()})
    )
    walking = (
        Continuous(Gaussian({DISTURBANCE_PREFIX + name: scalar(value) for name, value in walk.items()}))
        if walk
        else None
    )
    report = model.report_function
    wrap = lambda form, function: form(function, disturbances, kind)
    return StateSpace(
        system=model.system,
        transition=wrap(DisturbedTransition, model.transition_function),
        observation=wrap(DisturbedObservation, model.observation_function),
        report=None if report is None else wrap(DisturbedReport, report),
        process_noise=join(model.process_noise, walking),
        measurement_noise=around(model.measurement_noise, lambda law: wrap(DisturbedNoise, law)),
        prior=Prior(joint(*model.prior.mean, *[scalar(0.0)] * len(prior)), law),
        inputs=model.inputs,
        angles=model.angles,
        input_path=model.input_path,
        chosen=model.chosen,
    )
