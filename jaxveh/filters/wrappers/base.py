"""Bases of wrappers around Gaussian filters that have a memory."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.contracts import contract
from jaxveh._core.errors import InputError, check_positive, real_array, word_for
from jaxveh._core.own_results import instance_of, not_none
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.wrapper import AbstractGaussianWrapper
from jaxveh.filters.outer_belief import AbstractTransparentBelief
from jaxveh.statespace import CauchyGaussianMixture, Gaussian, Info, Row, StateSpace, kit


class Remembering(AbstractTransparentBelief):
    """The belief of the filter `inside`, and the wrapper's own state, `memory`, a tree of arrays."""

    inside: Any
    memory: Any

    def inflate(self, factor):
        """The belief with its covariance multiplied by `factor`."""
        return Remembering(self.inside.inflate(factor), self.memory)


class AbstractRemembering(AbstractGaussianWrapper):
    """A filter around another with a memory of the rows so far, by which it changes the noises of the inner filter's model.

    A subclass writes `start`, `believed_model` and `update`, which learns: `update_inside`, then a `Remembering` of its belief
    `inside` and the new memory.
    """

    _contract = contract(start=not_none, believed_model=instance_of(StateSpace, "a StateSpace"))

    @abc.abstractmethod
    def start(self, model: StateSpace) -> Any:
        """The memory before the first row."""

    @abc.abstractmethod
    def believed_model(self, model: StateSpace, memory: Any) -> StateSpace:
        """The model with the noises that follow from the memory."""

    def prior(self, model, row):
        memory = self.start(model)
        return Remembering(self.inner.prior(self.believed_model(model, memory), row), memory)

    def predict_between(self, model, belief, t, u_next):
        own = self.believed_model(model, belief.memory)
        return Remembering(self.inner.predict_between(own, belief.inside, t, u_next), belief.memory)

    def observe(self, model, belief, row):
        return self.inner.observe(self.believed_model(model, belief.memory), belief.inside, row)

    def adapted_model(self, model, belief):
        return self.inner.adapted_model(self.believed_model(model, belief.memory), belief.inside)

    def update_inside(self, model: StateSpace, belief: Remembering, row: Row) -> tuple[Remembering, Info]:
        """The inner filter's update with the noises that follow from the memory."""
        after, info = self.inner.update(self.believed_model(model, belief.memory), belief.inside, row)
        return Remembering(after, belief.memory), info


class AbstractLearnedNoise(AbstractRemembering):
    """A filter around another that estimates the variances of the measurement noise, which must be Gaussian with one
    standard deviation per channel. A filter inside that estimates them too would use its own, and is refused."""

    rows_between: ClassVar[bool] = True

    def check(self, model):
        who = type(self).__name__
        check_independent(who, model)
        if (kind := kit.who_lacks(self.inner, "noise_by_row")) is not None:
            raise InputError(
                f"{who}: {kind} inside it does not take its measurement noise row by row (`noise_by_row`), and would use its "
                f"own: {who} would do nothing. Take one of the two."
            )
        self.inner.check(model)


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


def check_independent(who: str, model: StateSpace) -> None:
    """Raise `InputError` unless the measurement noise is Gaussian with one standard deviation per channel."""
    kit.check_fixed(who, model.measurement_noise, "Use the inner filter without this wrapper, or a particle filter.")
    if not isinstance(model.measurement_noise, Gaussian):
        kind = word_for(model.measurement_noise)
        raise InputError(f"{who}: the measurement noise is {kind}: must be Gaussian, a standard deviation per channel.")


def check_has_levels(who: str, model: StateSpace) -> None:
    """Raise `InputError` unless the measurement noise has a standard deviation per channel, as a Gaussian or a Gaussian part."""
    if not isinstance(model.measurement_noise, Gaussian | CauchyGaussianMixture):
        kind = word_for(model.measurement_noise)
        raise InputError(
            f"{who}: the measurement noise is {kind}: must be Gaussian, a standard deviation per channel. Let the wrapper refuse "
            "it first: derive it from kit.AbstractReweighting or kit.AbstractLearnedNoise."
        )


def variances_of(model: StateSpace) -> Any:
    """The measurement noise's variances (m,), in the order of the channels; of a `CauchyGaussianMixture` those of its Gaussian
    part. **Raises** `InputError` for another law."""
    check_has_levels("variances_of", model)
    return jnp.square(jnp.stack(model.measurement_noise.std))


def with_variances(model: StateSpace, variances: Any) -> StateSpace:
    """The model with these variances (m,) of the measurement noise; of a `CauchyGaussianMixture` of its Gaussian part.
    **Raises** `InputError` for another law, another shape, and variances that are not positive."""
    check_has_levels("with_variances", model)
    kind = type(model.measurement_noise.std)
    variances, needed = real_array("with_variances: variances", variances), (len(kind._fields),)
    if variances.shape != needed:
        raise InputError(
            f"with_variances: variances has shape {variances.shape}: must be {needed}, one for each of {', '.join(kind._fields)}."
        )
    check_positive("with_variances: variances", variances)
    return eqx.tree_at(lambda m: m.measurement_noise.std, model, kind(*jnp.sqrt(variances)))
