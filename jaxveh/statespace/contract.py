"""The definition of a filter: `init` applies the first row, `step` propagates and applies the next; both return `info`."""

# No postponed annotations in this file: they would make fields of class variables.

import abc
import enum
from typing import Any, ClassVar, final

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import InputError, check_key, kind_of_inner, word_for
from jaxveh._core.own_results import belief_and_info, not_none
from jaxveh._core.parameter import check_parameters
from jaxveh.numerics import apart
from jaxveh.statespace.belief import AbstractBelief, Info
from jaxveh.statespace.measurements import likelihood_result
from jaxveh.statespace.model import Row, StateSpace, check_model
from jaxveh.statespace.told_rows import check_belief, check_has_count, check_rows

KEPT = "kept for the backward pass"
"""Name (`jax.ad_checkpoint.checkpoint_name`) of the values that a step keeps for its gradient: small, but slow to recompute."""


class Smoothing(enum.Enum):
    """How a filter can be smoothed: `none`; `gaussian`, by the backward steps of Rauch, Tung & Striebel, since it predicts with
    exactly the transition and the process noise of its `adapted` model, by the rule of the filter inside all wrappers;
    `particles`, by ancestors or backward sampling, since its weighted particles are its whole belief."""

    none = "none"
    gaussian = "gaussian"
    particles = "particles"


class Gradient(enum.Enum):
    """The kind of derivatives of a filter's log-likelihood: `none`, not usable; `on_average`, correct on average over keys,
    while for a given key the value jumps where other particles are chosen; `exact`, the derivatives of its value."""

    none = 0
    on_average = 1
    exact = 2


class AbstractFilter(Checked, eqx.Module):
    """The contract of every filter.

    `init(model, row, key) -> (belief, info)` takes the prior as the belief at the first row's time and applies its
    measurement, without propagation. `step(model, belief, row) -> (belief, info)` propagates with the inputs of the
    previous row over the time between, then applies the row's measurement with its own inputs. Both return the
    info of their row, so that the log-likelihoods add up to that of all measurements.

    Both are final: they run `_init` and `_step`, which a filter implements, as separate programs, so that a scan, a live loop
    and a resumed run agree bit for bit. Most filters predict and then update: they derive from `AbstractTwoPartFilter`.

    A filter declares its capabilities; the default of each is *no*:

    - `whitens`: its info has whitened innovations.
    - `has_covariance`: its belief has the `mean` and the `covariance` of the state.
    - `gradients`: the kind of derivatives of its log-likelihood (`gradients_of`).
    - `smooths`: how it can be smoothed. It is not inherited (`smoothing_of`): each class declares its own, since a class that
      predicts differently from its base class would be smoothed wrongly without a warning.
    - `noise_by_row`: the model's measurement noise may differ from row to row, and is used as given. (Not if the filter learns
      a noise of its own.)
    - `written_out`: in a batch its steps are written out in scalars if there are few states (`numerics.scan_written_out`), and
      have the batch's axis last for up to 14 states (`numerics.scan_batch_last`).
    - `shares_covariances`: in a batch of runs with the same noises and no missing row, it has one covariance for all.
    - `rows_between`: rows may be inserted between others, since its step depends only on the time that passes. (Not if each
      step adds noise, or learns noise.)

    A wrapper has a capability if it and the filters inside it declare it (`AbstractWrapper`).
    """

    whitens: ClassVar[bool] = False
    has_covariance: ClassVar[bool] = False
    smooths: ClassVar[Smoothing] = Smoothing.none
    noise_by_row: ClassVar[bool] = False
    rows_between: ClassVar[bool] = False
    written_out: ClassVar[bool] = False
    shares_covariances: ClassVar[bool] = False
    _contract = contract(_init=belief_and_info, _step=belief_and_info)

    def __init_subclass__(cls, **given):
        super().__init_subclass__(**given)
        for name in ("init", "step"):
            if name in vars(cls):
                raise TypeError(f"{cls.__name__}.{name}: is final. Write _{name}, which it runs.")

    def __check_init__(self):
        check_parameters(self)

    @property
    def gradients(self) -> Gradient:
        """The kind of derivatives of its log-likelihood."""
        return Gradient.none

    @property
    def needs_key(self) -> bool:
        """Whether it draws random numbers, so that `init` needs a key."""
        return False

    @final
    def init(self, model: StateSpace, row: Row, key=None) -> tuple[AbstractBelief, Info]:
        """The belief after the first row.

        **Raises** `InputError` if the filter draws random numbers and there is no key, does not support the model, and for a row
        of another model.
        """
        who = type(self).__name__
        check_model(who, model)
        check_rows(who, model, row, 0)
        self.check(model)
        return apart(self._first, row.t, model, row, key_for(self, key))

    @final
    def step(self, model: StateSpace, belief: Any, row: Row) -> tuple[AbstractBelief, Info]:
        """The belief after the next row.

        **Raises** `InputError` for a row of another model, and a belief of another filter or model.
        """
        who = type(self).__name__
        check_model(who, model)
        check_has_count(who, belief)
        check_rows(who, model, row, 0)
        return apart(self._next_of_own, belief.count, model, belief, row)

    @final
    def _next_of_own(self, model: StateSpace, belief: Any, row: Row) -> tuple[AbstractBelief, Info]:
        """The next belief, with a check that takes no time once a program is compiled."""
        key = jax.random.key(0) if self.needs_key else None
        like, _ = eqx.filter_eval_shape(lambda model, row: self._first(model, row, key), model, row)
        check_belief(type(self).__name__, belief, like)
        return self._next(model, belief, row)

    @final
    def _first(self, model: StateSpace, row: Row, key: Any) -> tuple[AbstractBelief, Info]:
        return _judged(*self._init(model, row, key))

    @final
    def _next(self, model: StateSpace, belief: Any, row: Row) -> tuple[AbstractBelief, Info]:
        return _judged(*self._step(model, belief, row))

    @abc.abstractmethod
    def check(self, model: StateSpace) -> None:
        """Raise `InputError` early, by name, if this filter does not support the model."""

    @abc.abstractmethod
    def _init(self, model: StateSpace, row: Row, key: Any) -> tuple[AbstractBelief, Info]:
        """The belief after the first row; `key` is None if the filter needs none."""

    @abc.abstractmethod
    def _step(self, model: StateSpace, belief: Any, row: Row) -> tuple[AbstractBelief, Info]:
        """The belief after the next row."""


def _judged(belief: Any, info: Info) -> tuple[Any, Info]:
    """A belief and its info, whose infinite log-likelihood is a result code. NaN says that there is none, as of observers; info
    of a user's own filter may lack both."""
    if not {"log_likelihood", "result"} <= set(info._fields):
        return belief, info
    infinite = jnp.isinf(info.log_likelihood)
    judged = likelihood_result(info.result, jnp.where(infinite, info.log_likelihood, 0.0))
    return belief, info._replace(result=judged)


class AbstractTwoPartFilter(AbstractFilter):
    """A filter that predicts, then updates: a wrapper that changes one of the two implements only that one.

    The value that `_start` and `_predict` pass to `_update` is the filter's own (a belief, or particles without their weights),
    and opaque to wrappers.
    """

    _contract = contract(_start=not_none, _predict=not_none, _update=belief_and_info)

    @abc.abstractmethod
    def _start(self, model: StateSpace, row: Row, key: Any) -> Any:
        """The prior at the row's time, before its measurement."""

    @abc.abstractmethod
    def _predict(self, model: StateSpace, belief: Any, row: Row) -> Any:
        """The prediction at the row's time, before its measurement."""

    @abc.abstractmethod
    def _update(self, model: StateSpace, ahead: Any, row: Row) -> tuple[AbstractBelief, Info]:
        """The belief after the row's measurement, from the prediction `ahead`."""

    @final
    def _init(self, model, row, key):
        return self._update(model, self._start(model, row, key), row)

    @final
    def _step(self, model, belief, row):
        return self._update(model, self._predict(model, belief, row), row)


class AbstractWrapper(AbstractFilter):
    """A filter around another, `inner`."""

    inner: eqx.AbstractVar[AbstractFilter]

    def __check_init__(self):
        if not isinstance(self.inner, AbstractFilter):
            raise InputError(
                f"{type(self).__name__}: {kind_of_inner(self.inner)} inside: must be a filter, such as filters.Unscented()."
            )

    @property
    def needs_key(self):
        return self.inner.needs_key


class AbstractTwoPartWrapper(AbstractTwoPartFilter, AbstractWrapper):
    """A wrapper that changes the prediction, the update, or both: the part that it does not implement is that of `inner`."""

    inner: eqx.AbstractVar[AbstractTwoPartFilter]

    def __init_subclass__(cls, **given):
        super().__init_subclass__(**given)
        for name in ("predict", "update"):
            if name in vars(cls) and not cls.__name__.startswith("Abstract") and not hasattr(super(cls, cls), name):
                raise TypeError(
                    f"{cls.__name__}.{name}: nothing calls it, since no base of {cls.__name__} has a method {name}. Write "
                    f"_{name}, or take a base that has it: filters.kit.AbstractStateless has update."
                )

    def __check_init__(self):
        if not isinstance(self.inner, AbstractTwoPartFilter):
            raise InputError(
                f"{type(self).__name__}: {kind_of_inner(self.inner)} inside: must be a filter whose step is a prediction and an "
                "update (AbstractTwoPartFilter)."
            )

    def check(self, model):
        self.inner.check(model)

    def _start(self, model, row, key):
        return self.inner._start(model, row, key)

    def _predict(self, model, belief, row):
        return self.inner._predict(model, belief, row)

    def _update(self, model, ahead, row):
        return self.inner._update(model, ahead, row)


def check_told(filter: Any, model: Any) -> None:
    """Raise unless these are a filter instance and a model, in this order."""
    if isinstance(filter, type) and issubclass(filter, AbstractFilter):
        raise InputError(f"filter = {filter.__name__}: is a class; make one of it: {filter.__name__}(...).")
    for name, value, kind, example in (
        ("filter", filter, AbstractFilter, "a filter, such as filters.Unscented()"),
        ("model", model, StateSpace, "a StateSpace, as returned by estimators.state_space"),
    ):
        if not isinstance(value, kind):
            raise InputError(f"{name} = {word_for(value)}: must be {example}. The order is filter, model, recording.")


def layers(filter: Any) -> tuple[Any, ...]:
    """A filter and all inside it, from the outermost to the innermost."""
    found = [filter]
    while isinstance(found[-1], AbstractWrapper):
        found.append(found[-1].inner)
    return tuple(found)


def innermost(filter: Any) -> Any:
    """The filter inside all wrappers."""
    return layers(filter)[-1]


def key_for(filter: AbstractFilter, key: Any) -> Any:
    """The key, or None if the filter needs none.

    **Raises** `InputError` if it needs a key and there is none.
    """
    if not filter.needs_key:
        return None
    if key is None:
        who = type(innermost(filter)).__name__
        raise InputError(f"{who} draws random numbers: give it a key, e.g. key=jax.random.key(0).")
    check_key(type(innermost(filter)).__name__, key)
    return key
