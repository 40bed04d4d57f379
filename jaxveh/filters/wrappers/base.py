"""What wrappers around Gaussian filters have in common."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, AbstractRuleFilter, check_kind
from jaxveh.statespace import Gaussian, Row, StateSpace
from jaxveh.statespace.contract import AbstractBelief, Info
from jaxveh.statespace.dependent_noise import check_fixed


class AbstractStateless(AbstractGaussianFilter):
    """A filter around another, `filter`, that remembers nothing: its belief is that of its filter."""

    # No postponed annotations in this file: they would make a field of it.
    filter: eqx.AbstractVar[AbstractGaussianFilter]

    def __check_init__(self):
        check_kind(type(self).__name__, self.filter, AbstractGaussianFilter)

    def check(self, model):
        self.filter.check(model)

    def prior(self, model, row):
        return self.filter.prior(model, row)

    def predict_between(self, model, belief, t, u_next):
        return self.filter.predict_between(model, belief, t, u_next)

    def observe(self, model, belief, row):
        return self.filter.observe(model, belief, row)

    def adapted(self, model, belief):
        return self.filter.adapted(model, belief)


class Remembering(AbstractBelief):
    """The belief of the filter `inside`, and what the wrapper remembers: `memory`, a tree of arrays."""

    inside: Any
    memory: Any

    @property
    def mean(self):
        """The state's mean."""
        return self.inside.mean

    @property
    def std(self):
        """The state's standard deviations."""
        return self.inside.std

    @property
    def covariance(self):
        """(n, n) in the order of the state's fields."""
        return self.inside.covariance

    @property
    def t(self):
        """Time of the last row, s."""
        return self.inside.t

    @property
    def u(self):
        """Inputs of the last row."""
        return self.inside.u

    @property
    def count(self):
        """Rows so far."""
        return self.inside.count

    def inflated(self, factor):
        """The belief with `factor` times its covariance."""
        return Remembering(self.inside.inflated(factor), self.memory)

    def moments(self, model):
        return self.inside.moments(model)


class AbstractRemembering(AbstractGaussianFilter):
    """A filter around another that remembers what it has seen, and gives its filter a model with other noises."""

    filter: eqx.AbstractVar[AbstractGaussianFilter]
    learns_variances: ClassVar[bool] = False
    """Whether it replaces the measurement noise by one of its own."""

    def __check_init__(self):
        check_kind(type(self).__name__, self.filter, AbstractGaussianFilter)

    @abc.abstractmethod
    def start(self, model: StateSpace) -> Any:
        """The memory before the first row."""

    @abc.abstractmethod
    def believed(self, model: StateSpace, memory: Any) -> StateSpace:
        """The model with the noises that the memory says."""

    def prior(self, model, row):
        memory = self.start(model)
        return Remembering(self.filter.prior(self.believed(model, memory), row), memory)

    def predict_between(self, model, belief, t, u_next):
        own = self.believed(model, belief.memory)
        return Remembering(self.filter.predict_between(own, belief.inside, t, u_next), belief.memory)

    def observe(self, model, belief, row):
        return self.filter.observe(self.believed(model, belief.memory), belief.inside, row)

    def adapted(self, model, belief):
        return self.filter.adapted(self.believed(model, belief.memory), belief.inside)

    def update_inside(self, model: StateSpace, belief: Remembering, row: Row) -> tuple[Remembering, Info]:
        """The filter's own update with the noises that the memory says."""
        after, info = self.filter.update(self.believed(model, belief.memory), belief.inside, row)
        return Remembering(after, belief.memory), info


def gaussian_of(belief: Any) -> GaussianBelief:
    """The Gaussian inside a wrapped filter's belief."""
    while not isinstance(belief, GaussianBelief):
        belief = belief.inside
    return belief


def with_gaussian(belief: Any, gaussian: GaussianBelief) -> Any:
    """A wrapped filter's belief with another Gaussian inside."""
    if isinstance(belief, GaussianBelief):
        return gaussian
    return Remembering(with_gaussian(belief.inside, gaussian), belief.memory)


def rule_filter_of(filter: Any) -> AbstractRuleFilter:
    """The filter that wrappers go around."""
    while not isinstance(filter, AbstractRuleFilter):
        filter = filter.filter
    return filter


def check_independent(who: str, model: StateSpace) -> None:
    """Raise `InputError` unless the measurement noise is one standard deviation a channel."""
    check_fixed(who, model.measurement_noise, "Take the filter inside by itself, or a particle filter.")
    if not isinstance(model.measurement_noise, Gaussian):
        kind = type(model.measurement_noise).__name__
        raise InputError(f"{who}: the measurement noise is {kind}: must be Gaussian, a standard deviation a channel.")


def check_variances_count(who: str, filter: Any) -> None:
    """Raise `InputError` where a filter inside takes measurement noise of its own for the one that it is given."""
    while filter is not None:
        if getattr(filter, "learns_variances", False):
            kind = type(filter).__name__
            raise InputError(
                f"{who}: {kind} inside it would replace its variances. Put {who} inside: {kind}({who}(...))."
            )
        filter = getattr(filter, "filter", None)


def variances_of(model: StateSpace) -> Any:
    """The measurement noise's variances (m,), in the order of the channels."""
    return jnp.square(jnp.stack(model.measurement_noise.std))


def with_variances(model: StateSpace, variances: Any) -> StateSpace:
    """The model with these variances (m,) of its measurement noise."""
    kind = type(model.measurement_noise.std)
    return eqx.tree_at(lambda m: m.measurement_noise.std, model, kind(*jnp.sqrt(variances)))
