"""Inputs that are measured with noise: their errors become states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive, check_single
from jaxveh._core.names import check_names, record_type
from jaxveh.statespace.dependent_noise import around
from jaxveh.statespace.independent import combine
from jaxveh.statespace.model import LinearInput, Prior, StateSpace, check_model
from jaxveh.statespace.noise import Gaussian
from jaxveh.statespace.process import AbstractProcessNoise, join


def uncertain_inputs(
    model: StateSpace, std: Mapping[str, float], correlation: Mapping[str, float] | None = None
) -> StateSpace:
    """The model with inputs that have an error, the same in transition and observation: u + e.

    `std`: the error's standard deviation by input, in its unit. It is white from row to row, unless `correlation` gives its
    time constant (s). Then `e` is a Gauss-Markov process with this standard deviation, as for a sensor whose offset wanders.
    Each error is a state `<input>_error`, reported with the other states if the model has no report of its own. For inputs
    that are linear over a step, the error at the step's first row is held over the step.

    Neglecting the noise of inputs makes a filter overconfident: half a degree of hand wheel matters as much as a gyroscope's
    noise.

    **Raises** `InputError` for an unknown input, a number that is not positive, or a model with chosen parameters (make the
    inputs uncertain first).
    """
    check_model("uncertain_inputs", model)
    times = dict(correlation or {})
    check_names("uncertain_inputs", std, model.inputs)
    check_names("uncertain_inputs: correlation", times, std)
    for name, value in (*std.items(), *times.items()):
        check_single(**{f"uncertain_inputs: {name}": value})
        check_positive(f"uncertain_inputs: {name}", value)
    if not std:
        raise InputError("uncertain_inputs: std is empty: give the standard deviation of at least one input's error.")
    if model.chosen is not None:
        raise InputError("uncertain_inputs: parameters are chosen already; make the inputs uncertain first.")
    errors = Errors(tuple(std), tuple(float(times.get(name, 0.0)) for name in std), type(model.prior.mean))
    like = model.prior.mean[0]
    spreads = Gaussian({f"{name}_error": jnp.asarray(value, like.dtype) for name, value in std.items()})
    mean = errors.state_type(*model.prior.mean, *[jnp.zeros_like(like)] * len(errors.inputs))
    return StateSpace(
        system=model.system,
        transition=Moved(model.transition_function, errors),
        observation=Observed(model.observation_function, errors),
        process_noise=join(model.process_noise, Wandering(spreads, errors.times)),
        measurement_noise=around(model.measurement_noise, lambda law: Observed(law, errors)),
        prior=Prior(mean, combine(model.prior.law, spreads)),
        inputs=model.inputs,
        report=None if model.report_function is None else Observed(model.report_function, errors),
        angles=model.angles,
        input_path=model.input_path,
    )


class Errors(eqx.Module):
    """The inputs with errors, the errors' time constants (s; 0: white), and the model's own state type."""

    inputs: tuple[str, ...] = eqx.field(static=True)
    times: tuple[float, ...] = eqx.field(static=True)
    inside: Any = eqx.field(static=True)

    @property
    def state_type(self):
        """The model's state followed by the errors."""
        return record_type("State", (*self.inside._fields, *[f"{name}_error" for name in self.inputs]))

    def split(self, x):
        """The model's own state, and the errors in a list."""
        n = len(self.inside._fields)
        return self.inside(*x[:n]), list(x[n:])

    def add(self, u, errors):
        """The inputs plus their errors, at an instant or along a step."""
        if isinstance(u, LinearInput):
            return LinearInput(u.t0, u.t1, self.add(u.u0, errors), self.add(u.u1, errors))
        return u._replace(**{n: getattr(u, n) + error for n, error in zip(self.inputs, errors, strict=True)})


class Moved(eqx.Module):
    """Moves the model's own state with the inputs plus their errors, which decay."""

    function: Callable = eqx.field(static=True)
    errors: Errors = eqx.field(static=True)

    def __call__(self, system, t0, t1, x, u):
        state, errors = self.errors.split(x)
        state = self.function(system, t0, t1, state, self.errors.add(u, errors))
        kept = [_share_left(t1 - t0, time) * error for time, error in zip(self.errors.times, errors, strict=True)]
        return self.errors.state_type(*state, *kept)


class Observed(eqx.Module):
    """The observation, the noise law or the report for the model's own state, with the inputs plus their errors."""

    function: Callable = eqx.field(static=True)
    errors: Errors = eqx.field(static=True)

    def __call__(self, system, t, x, u):
        state, errors = self.errors.split(x)
        return self.function(system, t, state, self.errors.add(u, errors))


class Wandering(AbstractProcessNoise):
    """The new noise per step of a Gauss-Markov process with standard deviations `law` and these time constants (s; 0:
    white)."""

    law: Gaussian
    times: tuple[float, ...] = eqx.field(static=True)

    @property
    def grows_with_time(self):
        return all(time > 0 for time in self.times)

    def over(self, dt):
        fresh = [numerics.sqrt(1.0 - _share_left(dt, time) ** 2) for time in self.times]
        return eqx.tree_at(
            lambda law: law.std,
            self.law,
            type(self.law.std)(*[std * share for std, share in zip(self.law.std, fresh, strict=True)]),
        )


def _share_left(dt, time: float):
    """The share of an error that is left after `dt` (s)."""
    return jnp.exp(-dt / time) if time else jnp.zeros_like(dt)
