"""What a filter is: `init` applies the first row, `step` propagates and applies the next; both report an info."""

from __future__ import annotations

import abc
import enum
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh._core.result import Result, code
from jaxveh.statespace.model import Row, StateSpace

KEPT = "kept for the backward pass"
"""Name (`jax.ad_checkpoint.checkpoint_name`) of what a step keeps for its gradient: small, and long to compute again."""


class Info(NamedTuple):
    """What a person wants to know of one step.

    `log_likelihood`: the increment, log p(y_k | y_0..k-1). `innovation`, `innovation_std`: measurement less prediction
    and its predicted spread, NamedTuples by channel, NaN where missing. `nis`: normalised innovation squared over the
    channels present (Gaussian filters; expected value: their number). `ess`: effective sample size after the
    measurement, (particle filters, else NaN). `result`: code, see `jaxveh.Result`. `whitened`, `log_scale`: innovations
    decorrelated in the order of the channels and the logarithm of what each was divided by, zero where missing (Gaussian
    filters, else None): `-0.5 whitened^2 - log_scale - 0.5 log(2 pi)` of the channels present add up to the log-likelihood.
    `remark` (particle filters, else None): the code of what a person should know though the filter went on, else zero.
    """

    log_likelihood: Any
    innovation: Any
    innovation_std: Any
    nis: Any
    ess: Any
    result: Any
    whitened: Any = None
    log_scale: Any = None
    remark: Any = None


class AbstractBelief(eqx.Module):
    """What a filter knows after a row: all that the next step needs, its `t`, `u` and the `count` of rows included."""

    @abc.abstractmethod
    def moments(self, model: StateSpace) -> tuple[Any, Any]:
        """Mean and standard deviation of `model.report` under the belief: two NamedTuples of scalars."""

    @property
    def mean(self) -> Any:
        """The state's mean (parameters on the real line), the state's NamedTuple."""
        raise self._lacks("mean")

    @property
    def covariance(self) -> Any:
        """(n, n) in the order of the state's fields."""
        raise self._lacks("covariance")

    def sample(self, key, draws: int) -> Any:
        """Draws: the state's NamedTuple with (draws,) in each field; of a Gaussian, unless the belief is something else."""
        mean = jnp.stack(self.mean)
        white = numerics.normal(key, (mean.shape[0], draws), mean.dtype)
        return type(self.mean)(*(mean[:, None] + numerics.cholesky(self.covariance) @ white))

    def _lacks(self, what: str) -> InputError:
        return InputError(f"{type(self).__name__} has no {what} of the state: take a filter whose belief has one.")


class Smoothing(enum.Enum):
    """How a filter can be smoothed: `none`; `gaussian`, by the steps back of Rauch, Tung & Striebel, since it predicts by the
    transition and the process noise of its `adapted` model, through the rule inside all wrappers, and nothing else; `particles`,
    by ancestors or backward sampling, since its weighted particles are all that it knows of a row."""

    none = "none"
    gaussian = "gaussian"
    particles = "particles"


class AbstractFilter(eqx.Module):
    """The contract of every filter.

    `init(model, row, key) -> (belief, info)` takes the prior as the belief at the first row's time and applies its
    measurement, without propagation. `step(model, belief, row) -> (belief, info)` propagates with the inputs of the
    previous row over the time between, then applies the row's measurement with its own inputs. Both return the
    info of their row, so that the log-likelihoods add up to that of all measurements. `whitens`: whether its infos carry
    whitened innovations. `smooths`: how it can be smoothed, which each class declares for itself: what predicts otherwise
    than the class it comes from would be smoothed wrongly without a word, so that this is not inherited (`smoothing_of`).
    """

    whitens: ClassVar[bool] = False
    smooths: ClassVar[Smoothing] = Smoothing.none

    @abc.abstractmethod
    def check(self, model: StateSpace) -> None:
        """Raise `InputError` early, by name, where the model asks for what this filter cannot."""

    @abc.abstractmethod
    def init(self, model: StateSpace, row: Row, key=None) -> tuple[AbstractBelief, Info]:
        """The belief after the first row."""

    @abc.abstractmethod
    def step(self, model: StateSpace, belief: AbstractBelief, row: Row) -> tuple[AbstractBelief, Info]:
        """The belief after the next row."""


def smoothing_of(filter: Any) -> Smoothing:
    """How a filter can be smoothed: as its own class declares, and the filter inside, if it is a wrapper, allows."""
    own = vars(type(filter)).get("smooths", Smoothing.none)
    inside = getattr(filter, "filter", None)
    return own if inside is None or smoothing_of(inside) is own else Smoothing.none


def check_smooths(who: str, filter: Any) -> Smoothing:
    """How the filter can be smoothed, or an `InputError` that says which one cannot."""
    kind = smoothing_of(filter)
    if kind is not Smoothing.none:
        return kind
    while vars(type(filter)).get("smooths", Smoothing.none) is not Smoothing.none:
        filter = filter.filter
    name = type(filter).__name__
    raise InputError(
        f"{who}: {name} has no smoother: its class does not declare one (`smooths`, which is not inherited). Take a Gaussian "
        "filter or a particle filter that does; a filter of your own declares smooths = Smoothing.gaussian where it predicts as "
        "the filter inside."
    )


@eqx.filter_jit
def apart(function, condition, *operands):
    """`function(*operands)` as a program of its own, so that a step's bits do not depend on what surrounds it.

    XLA fuses a step with its surroundings, differently in a scan, in a live loop and beside other outputs, and rounds
    differently with it. It never fuses across a conditional: `condition` holds for every input, and XLA must not be able
    to know that. Called outside jit, this is compiled once as well. Transformations pass through; under differentiation
    there is no conditional, which would cost a copy of all that the backward pass needs.
    """
    arrays, rest = eqx.partition((function, operands), eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)

    def together(*leaves):
        function, operands = eqx.combine(jax.tree.unflatten(structure, leaves), rest)
        return function(*operands)

    @jax.custom_jvp
    def alone(condition, *leaves):
        never = lambda *_: jax.tree.map(_zeros, jax.eval_shape(together, *leaves))
        return jax.lax.cond(condition, together, never, *leaves)

    @alone.defjvp
    def _(primals, tangents):
        condition, *leaves = primals
        # In a batch the condition makes every result a batch. The selection does so here, where jax counts on the same.
        selected = lambda *leaves: jax.tree.map(lambda x: jnp.where(condition, x, _zeros(x)), together(*leaves))
        return jax.jvp(selected, tuple(leaves), tuple(tangents[1:]))

    return alone(condition, *leaves)


def _zeros(like):
    if jnp.issubdtype(like.dtype, jax.dtypes.prng_key):
        # The only generator that `numerics` draws from.
        return jax.random.wrap_key_data(jnp.zeros((*like.shape, 2), jnp.uint32), impl="threefry2x32")
    return jnp.zeros(like.shape, like.dtype)


def always(t):
    """True for every time, NaN included, as a condition on its bits: all but one of the NaNs that arithmetic never makes."""
    unsigned, odd = (jnp.uint32, 0x7FA55A5A) if t.dtype == jnp.float32 else (jnp.uint64, 0x7FF55A5A5A5A5A5A)
    return jax.lax.bitcast_convert_type(t, unsigned) != jnp.asarray(odd, unsigned)


def presence(model: StateSpace, row: Row) -> tuple[dict, dict]:
    """Measurements with missing ones replaced by zero, and which are present: two mappings by channel.

    NaN means missing; so does infinity here, and `input_result` reports it.
    """
    values = {name: getattr(row.y, name) for name in model.channels}
    present = {name: jnp.isfinite(value) for name, value in values.items()}
    filled = {name: jnp.where(present[name], value, jnp.zeros_like(value)) for name, value in values.items()}
    return filled, present


def input_result(model: StateSpace, row: Row):
    """`non_finite_input` where an input or the time is not finite, or a measurement is infinite."""
    bad = [~jnp.isfinite(leaf) for leaf in jax.tree.leaves((row.t, row.u))]
    bad += [jnp.isinf(getattr(row.y, name)) for name in model.channels]
    return jnp.where(jnp.any(jnp.stack(bad)), code(Result.non_finite_input), code(Result.successful))


def wrap_angle(angle):
    """The same angle in [-pi, pi)."""
    return angle - 2 * jnp.pi * jnp.floor(angle / (2 * jnp.pi) + 0.5)


def by_channel(model: StateSpace, values, present: dict):
    """A NamedTuple by channel, NaN where the channel is missing; `values` in the order of the channels."""
    pairs = zip(model.channels, values, strict=True)
    return record("Measurements", {name: jnp.where(present[name], value, jnp.nan) for name, value in pairs})
