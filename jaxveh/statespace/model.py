"""The contract between models and filters: transition, observation, noises, prior, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import (
    InputError,
    check_finite,
    check_kind,
    check_takes,
    float_array,
    word_for,
)
from jaxveh._core.names import as_names, check_names, record
from jaxveh._core.own_results import named_record, numbers_as_given
from jaxveh._core.parameter import UNNAMED
from jaxveh._core.recording import Recording, check_recording, time_for
from jaxveh._core.traced import trace_once
from jaxveh.statespace.dependent_noise import MeasurementNoise, StateDependent
from jaxveh.statespace.given_rows import channel_values, scalar_row
from jaxveh.statespace.noise import AbstractNoise, Gaussian
from jaxveh.statespace.one_model import check_one_model
from jaxveh.statespace.process import AbstractProcessNoise


class Row(NamedTuple):
    """A filter's input at one instant: time `t`, inputs `u` and measurements `y`, NaN where missing.

    `u` and `y` are NamedTuples of scalars; for a whole recording each leaf is (T,).
    """

    t: Any
    u: Any
    y: Any


class Prior(eqx.Module):
    """The belief at the first row's time before its measurement: a mean, and a law of the deviation.

    `mean` is the state's NamedTuple of scalars, `law` names every one of its fields (a `Gaussian` or a
    `MultivariateGaussian`; a plain mapping of standard deviations becomes a `Gaussian`).
    """

    mean: Any
    law: AbstractNoise

    def __init__(self, mean, law):
        if not hasattr(mean, "_fields"):
            raise InputError(f"prior mean = {word_for(mean)}: must be the state's NamedTuple.")
        for name, value in mean._asdict().items():
            check_finite(f"prior mean of {name}", value)
        self.mean = jax.tree.map(float_array, mean)
        self.law = law if isinstance(law, AbstractNoise) else Gaussian(law)

    def __check_init__(self):
        check_names("prior law", self.law.names, self.mean._fields)
        missing = [name for name in self.mean._fields if name not in self.law.names]
        if missing:
            raise InputError(
                f"prior: no spread for {', '.join(missing)}; every state needs a positive one "
                "(a quantity that is known exactly is an input or a parameter, not a state)."
            )

    def sample(self, key, shape: tuple[int, ...] = ()):
        """Draws of the state: the NamedTuple with arrays of `shape`."""
        noise = self.law.sample(key, shape)
        return type(self.mean)(*[m + noise[name] for name, m in self.mean._asdict().items()])

    def covariance(self) -> jax.Array:
        """(n, n) covariance in the order of the state's fields."""
        covariance, names = self.law.covariance(), self.law.names
        if names == self.mean._fields:
            return covariance
        order = np.array([names.index(name) for name in self.mean._fields])
        return covariance[order][:, order]


class StateSpace(eqx.Module):
    """A state-space model, by name.

    - `system`: the data that the functions need, a tree of float arrays (a vehicle with its sensors; None for none). It is
      stored once, so that a gradient with respect to a parameter is one number.
    - `transition(system, t0, t1, x, u) -> x`: the state at `t1` without noise. `observation(system, t, x, u) -> y`: the
      measurements without noise, a NamedTuple whose fields include every channel of `measurement_noise`.
    - `process_noise`: `Continuous(law)`, `Discrete(law)` or None; `measurement_noise`: a law whose names are the measured
      channels, or `StateDependent(function, channels)`; `prior`: the belief before the first measurement.
    - `inputs`: the recording's channels in `u`. `input_path`: `"held"` (u of the step's first row throughout)
      or `"linear"` (the transition gets a `LinearInput`, which `Propagate` evaluates along the step).
    - `report(system, t, x, u) -> NamedTuple`: the outputs of an Estimate (means and standard deviations); default the state.
    - `angles`: measured channels whose innovations wrap into (-pi, pi].

    `x`, `u`, `y` are NamedTuples of scalars; a batch of states has arrays in the fields, and the functions are
    elementwise in them (`PerPoint(f)` makes a function of single points elementwise). States that are angles are unwrapped
    reals. The functions are static (plain functions, or modules without arrays), so every new lambda is compiled again.
    """

    system: Any = eqx.field(metadata=UNNAMED)
    process_noise: AbstractProcessNoise | None
    measurement_noise: MeasurementNoise
    prior: Prior
    transition_function: Callable = eqx.field(static=True)
    observation_function: Callable = eqx.field(static=True)
    report_function: Callable | None = eqx.field(static=True)
    inputs: tuple[str, ...] = eqx.field(static=True)
    angles: tuple[str, ...] = eqx.field(static=True)
    input_path: str = eqx.field(static=True)
    chosen: Any = eqx.field(static=True)

    def __init__(
        self,
        *,
        transition: Callable,
        observation: Callable,
        process_noise: AbstractProcessNoise | None,
        measurement_noise: MeasurementNoise | Mapping,
        prior: Prior,
        system: Any = None,
        inputs: tuple[str, ...] = (),
        report: Callable | None = None,
        angles: tuple[str, ...] = (),
        input_path: str = "held",
        chosen: Any = None,
    ):
        self.system = system
        self.transition_function, self.observation_function, self.report_function = transition, observation, report
        self.process_noise = process_noise
        law = measurement_noise
        self.measurement_noise = law if isinstance(law, AbstractNoise | StateDependent) else Gaussian(law)
        self.prior = prior
        self.inputs, self.angles = as_names(inputs, "inputs"), as_names(angles, "angles")
        self.input_path = input_path
        self.chosen = chosen

    def __check_init__(self):
        check_kind("prior", self.prior, Prior, "statespace.Prior(mean, law) makes one.")
        _check_function("transition", self.transition_function, "system", "t0", "t1", "x", "u")
        _check_function("observation", self.observation_function, "system", "t", "x", "u")
        if self.report_function is not None:
            _check_function("report", self.report_function, "system", "t", "x", "u")
        if self.process_noise is not None:
            if not isinstance(self.process_noise, AbstractProcessNoise):
                raise InputError(
                    f"process_noise = {word_for(self.process_noise)}: must be Continuous(law) (unit per root "
                    "second) or Discrete(law) (per step), or None."
                )
            check_names("process noise", self.process_noise.law.names, self.states)
        check_names("angles", self.angles, self.channels)
        if self.input_path not in ("held", "linear"):
            raise InputError(f"input_path = {self.input_path!r}: must be 'held' or 'linear'.")

    @property
    def states(self) -> tuple[str, ...]:
        """The state's field names."""
        return self.prior.mean._fields

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured channels' names."""
        return self.measurement_noise.names

    @property
    def dtype(self) -> Any:
        """The precision of the state's mean, in which a filter computes."""
        return self.prior.mean[0].dtype

    def rows(self, recording: Recording) -> Row:
        """The recording as rows for this model: each leaf (T,); host-side checks, skipped for tracers.

        Raises `InputError` for a missing channel, NaN in an input (fill it first with `recording.fill`), or infinite values.
        In float32, times count from the first row, so that steps keep their digits.
        """
        check_recording("StateSpace.rows", recording)
        check_one_model(self.prior, self.process_noise, self.measurement_noise)
        check_names("recording lacks a channel the model needs", (*self.inputs, *self.channels), recording.names)
        dtype = self.dtype
        u = {name: channel_values(recording, name, dtype, is_input=True) for name in self.inputs}
        y = {name: channel_values(recording, name, dtype, is_input=False) for name in self.channels}
        time = jnp.asarray(time_for(recording, dtype), dtype)
        return Row(time, record("Inputs", u), record("Measurements", y))

    def row(self, t, u: Mapping, y: Mapping) -> Row:
        """One row for a live loop from plain numbers; channels left out of `y` are missing."""
        check_names("inputs", u, self.inputs)
        check_names("measurements", y, self.channels)
        missing = [name for name in self.inputs if name not in u]
        if missing:
            raise InputError(f"row: no value for the input(s) {', '.join(missing)}.")
        numbers = [*(u[name] for name in self.inputs), *(y.get(name, np.nan) for name in self.channels)]
        t, *others = scalar_row(t, numbers, self.dtype, (*self.inputs, *self.channels))
        inputs = record("Inputs", dict(zip(self.inputs, others, strict=False)))
        measured = record("Measurements", dict(zip(self.channels, others[len(self.inputs) :], strict=True)))
        return Row(t, inputs, measured)

    def transition(self, t0, t1, x, u):
        """The state at `t1` without noise, from the state `x` at `t0`."""
        moved = trace_once(self.transition_function, self.system, t0, t1, x, u)
        if getattr(moved, "_fields", None) != x._fields:
            raise InputError(f"transition returned {word_for(moved)}: must be the state, with {', '.join(x._fields)}.")
        numbers_as_given("transition", (self.system, t0, t1, x, u), moved)
        return moved

    def observation(self, t, x, u):
        """The measurements without noise."""
        seen = trace_once(self.observation_function, self.system, t, x, u)
        lacks = [name for name in self.channels if name not in getattr(seen, "_fields", ())]
        if lacks:
            raise InputError(
                f"observation returned {word_for(seen)}, without {', '.join(lacks)}: must have every channel of the "
                f"measurement noise ({', '.join(self.channels)})."
            )
        numbers_as_given("observation", (self.system, t, x, u), seen)
        return seen

    def measurement_law(self, t, x, u) -> AbstractNoise:
        """The law of the measurement noise at one state (a NamedTuple of scalars)."""
        noise = self.measurement_noise
        return noise.at(self.system, t, x, u) if isinstance(noise, StateDependent) else noise

    def report(self, t, x, u):
        """The outputs of an Estimate for a state (or for a batch of states), in physical units."""
        if self.report_function is None:
            return x
        said = self.report_function(self.system, t, x, u)
        named_record("report", self, (), said)
        return said

    def step_inputs(self, t0, t1, u0, u1):
        """The `u` that `transition` receives between two rows."""
        return u0 if self.input_path == "held" or not self.inputs else LinearInput(t0, t1, u0, u1)


def _check_function(name: str, function: Any, *arguments: str) -> None:
    check_takes(f"StateSpace: {name}", function, *arguments)
    if isinstance(function, PerPoint):
        check_takes(f"StateSpace: {name}.function", function.function, *arguments)


class LinearInput(eqx.Module):
    """Inputs that run linearly from `u0` at `t0` to `u1` at `t1`; over a step of zero length they are `u0`."""

    t0: Any
    t1: Any
    u0: Any
    u1: Any

    def at(self, t):
        """The inputs at time t, the NamedTuple of scalars."""
        length = self.t1 - self.t0
        share = (t - self.t0) / jnp.where(length == 0, 1.0, length)
        return jax.tree.map(lambda a, b: a + share * (b - a), self.u0, self.u1)


class PerPoint(eqx.Module):
    """Makes a function of single points, `f(system, *times, x, u)`, elementwise over a batch of states by `vmap`.

    For models with matrices or branches inside; a function that is already elementwise is faster without it.
    """

    function: Callable = eqx.field(static=True)

    def __call__(self, system, *args):
        *times, x, u = args
        shape = jnp.broadcast_shapes(*[jnp.shape(leaf) for leaf in jax.tree.leaves(x)])
        flat = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, shape).reshape(-1), x)
        out = jax.vmap(lambda point: self.function(system, *times, point, u))(flat)
        return jax.tree.map(lambda leaf: leaf.reshape(shape), out)


def cast(tree, dtype):
    """The same model, state or recording with every float array in `dtype` (float32 or float64).

    NumPy arrays stay unchanged: a recording's time stamps need float64 whatever dtype the channels have.
    """
    to = lambda leaf: leaf.astype(dtype) if isinstance(leaf, jax.Array) and eqx.is_inexact_array(leaf) else leaf
    return jax.tree.map(to, tree)


def check_model(who: str, model: Any) -> None:
    """Raise `InputError` unless it is a `StateSpace`."""
    if not isinstance(model, StateSpace):
        raise InputError(
            f"{who}: model = {word_for(model)}: must be a StateSpace, as returned by estimators.state_space."
        )
