"""The definition of an observer: a model that is corrected towards the measurements, without a covariance."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_finite
from jaxveh._core.result import Result, with_reason
from jaxveh.statespace import AbstractBelief, AbstractTwoPartFilter, Info, Row, StateSpace, kit


class PointBelief(AbstractBelief):
    """A state without a spread: `vector` (n,) in the order of the state's fields, and the observer's `memory`."""

    vector: jax.Array
    memory: Any
    t: Any
    u: Any
    count: Any
    state_type: Any = eqx.field(static=True)

    @property
    def mean(self):
        """The state, its NamedTuple."""
        return self.state_type(*self.vector)

    def moments(self, model):
        shown = model.report(self.t, self.mean, self.u)
        dtype = self.vector.dtype
        return jax.tree.map(lambda value: jnp.asarray(value, dtype), shown), jax.tree.map(
            lambda value: jnp.full_like(jnp.asarray(value, dtype), jnp.nan), shown
        )


class AbstractObserver(AbstractTwoPartFilter):
    """An observer moves its state by the model's transition, then by a correction from the measurement's error:

        x- = f(x, u),    e = y - h(x-, u),    x = x- + correction(e)

    Missing channels have e = 0 and correct nothing. Standard deviations, NIS and log-likelihoods are NaN: an observer does not
    compute them. `init` starts at the prior's mean and corrects it; `run` works as for filters.
    """

    # No postponed annotations in this file: they would make fields of class variables.
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True

    @abc.abstractmethod
    def start(self, model: StateSpace) -> Any:
        """The memory before the first row."""

    @abc.abstractmethod
    def predict(self, model: StateSpace, belief: PointBelief, row: Row) -> tuple[Any, Any]:
        """The state (n,) at the row's time before its measurement, most often by `advance`, and the memory then."""

    @abc.abstractmethod
    def correct(self, model: StateSpace, belief: PointBelief, row: Row, error: Any, here: Any) -> tuple[Any, Any]:
        """The state's correction (n,) from the errors (m,) of the channels that are present, `here` (m,), and the memory
        after it.

        The belief contains the predicted state and memory; its `t` is still the last row's (at the first row, this row's).
        """

    def _start(self, model, row, key):
        vector, kind = jnp.stack(model.prior.mean), type(model.prior.mean)
        return PointBelief(vector, self.start(model), row.t, row.u, jnp.int32(0), kind)

    def _predict(self, model, belief, row):
        vector, memory = self.predict(model, belief, row)
        return PointBelief(vector, memory, belief.t, belief.u, belief.count, belief.state_type)

    def _update(self, model, ahead, row):
        belief = ahead
        measured, present = kit.presence(model, row)
        here = jnp.stack([present[name] for name in model.channels])
        error = jnp.stack([measured[name] for name in model.channels]) - observe(model, row, belief.vector)
        wraps = jnp.asarray([name in model.angles for name in model.channels])
        error = jnp.where(here, jnp.where(wraps, numerics.wrap_angle(error), error), 0)
        correction, memory = self.correct(model, belief, row, error, here)
        vector = belief.vector + correction
        after = PointBelief(vector, memory, row.t, row.u, belief.count + 1, belief.state_type)
        return after, _info(model, row, error, present, vector)


def advance(model: StateSpace, belief: PointBelief, row: Row, vector: Any) -> Any:
    """Move a state (n,) from the belief's time to the row's time: (n,)."""
    u = model.step_inputs(belief.t, row.t, belief.u, row.u)
    moved = model.transition(belief.t, row.t, belief.state_type(*vector), u)
    return jnp.stack([jnp.asarray(value, vector.dtype) for value in moved])


def observe(model: StateSpace, row: Row, vector: Any) -> Any:
    """The measurements without noise for a state (n,): (m,), in the order of the channels."""
    found = model.observation(row.t, type(model.prior.mean)(*vector), row.u)
    return jnp.stack([jnp.asarray(getattr(found, name), vector.dtype) for name in model.channels])


def _info(model, row, error, present, vector) -> Info:
    nothing = jnp.full((), jnp.nan, vector.dtype)
    lost = ~jnp.all(jnp.isfinite(vector))
    return Info(
        log_likelihood=nothing,
        innovation=kit.by_channel(model, error, present),
        innovation_std=kit.by_channel(model, jnp.full_like(error, jnp.nan), present),
        nis=nothing,
        ess=nothing,
        result=with_reason(kit.input_result(model, row), lost, Result.non_finite_state),
    )


def check_gain(name: str, gain: Any, model: StateSpace, states: tuple[str, ...] | None = None) -> None:
    """Raise `InputError` unless a gain is finite and (states, channels); `states`: by default the model's."""
    states = model.states if states is None else states
    expected = (len(states), len(model.channels))
    check_finite(name, gain)
    if gain.shape != expected:
        raise InputError(
            f"{name} has shape {gain.shape}: must be {expected}, states {', '.join(states)} by channels "
            f"{', '.join(model.channels)}."
        )


def check_one_or_each(name: str, values: Any, each: tuple[str, ...]) -> None:
    """Raise `InputError` unless values are one number, or one for each of the names."""
    if values.shape not in ((), (len(each),)):
        raise InputError(f"{name} has shape {values.shape}: must be one, or one for each of {', '.join(each)}.")
