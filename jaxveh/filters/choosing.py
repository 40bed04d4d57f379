"""The choice of the next particles, and how derivatives pass through it: by a score, or by softened weights."""

# No postponed annotations in this file: they would turn class variables into fields.

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.ad_checkpoint import checkpoint_name

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, word_for
from jaxveh._core.parts import check_static
from jaxveh._core.result import Result
from jaxveh.numerics import derivative_alone
from jaxveh.statespace import kit


def score(log_probability):
    """Zero, with all derivatives of a draw's log-probability: it makes gradients through a choice right.

    A draw j of a category i of probability p_i is weighted by p_i over the same p_i without derivative: a factor of 1 by which
    the expectation's derivative includes the part that comes from choosing (A. Scibior & F. Wood, Differentiable particle
    filtering without modifying the forward pass, 2021; G. Poyiadjis, A. Doucet & S. Singh 2011).
    """
    return derivative_alone(log_probability)


def log_of(weights):
    """Log weights with -inf for zero, and zero instead of infinite gradients there; subnormal weights count as zero."""
    alive = weights >= jnp.finfo(weights.dtype).tiny
    return jnp.where(alive, jnp.log(numerics.or_one(weights, alive)), -jnp.inf)


def gather(particles, ancestors):
    """The ancestors' states; no derivative passes the draw itself."""
    take = lambda field: field.at[ancestors].get(mode="promise_in_bounds", indices_are_sorted=True)
    return jax.tree.map(take, particles)


class Resampled(NamedTuple):
    """The next particles, (n,) in each field; the index of the particle from which each comes, `ancestors` (n,) int32;
    the logarithms of their weights over 1 / n, with the derivative of the choice, `log_weights` (n,); and a `remark` on
    the choice, a code of `Result`."""

    particles: Any
    ancestors: Any
    log_weights: Any
    remark: Any = Result.successful


class AbstractResampling(eqx.Module):
    """A scheme that makes the next particles of weighted ones.

    A scheme declares its properties, which are False by default:

    - `keeps_ancestors`: each of the next particles is a copy of one before, its ancestor, drawn by the weights alone (`draw` of
      `AbstractDraw`). It is required by filters that choose ancestors before they move (`AuxiliaryParticleFilter`, `Guided`,
      `Marginalised`) and by smoothers that follow ancestors (`Genealogy`, `FixedLag`).
    - `reweights`: the weights of the next particles are not all 1 / n.
    """

    keeps_ancestors: ClassVar[bool] = False
    reweights: ClassVar[bool] = False

    def __check_init__(self):
        check_static(self)

    @abc.abstractmethod
    def resample(self, key, particles: Any, weights: Any, logs: Any, n: int, gradient: str) -> Resampled:
        """The next `n` particles, made of particles (N,) with normalised `weights` (N,), whose logarithms are `logs`;
        `gradient` as in the filters."""


class AbstractDraw(AbstractResampling):
    """A scheme that draws ancestors by the weights."""

    keeps_ancestors: ClassVar[bool] = True

    @abc.abstractmethod
    def draw(self, key, weights: Any, n: int) -> Any:
        """Ancestors (n,) int32, nondecreasing, drawn by weights (N,)."""

    @abc.abstractmethod
    def split(self, logs: Any) -> tuple[Any, Any]:
        """The log weights after the draw, over 1 / n, and the log-probabilities of the draw, for normalised log weights (N,)."""

    def resample(self, key, particles, weights, logs, n, gradient):
        ancestors = drawn_ancestors(self, key, weights, n)
        chosen = log_weights_after(self, logs, ancestors, gradient)
        return Resampled(gather(particles, ancestors), ancestors, chosen)


def check_scheme(name: str, scheme: Any) -> None:
    """Raise `InputError` unless `scheme` is a function, which an object or a class of schemes is not."""
    if not callable(scheme) or isinstance(scheme, type):
        raise InputError(
            f"{name} = {word_for(scheme)}: must be a function (key, weights, n) -> ancestors such as numerics.systematic, or for "
            "a filter's resampling an object such as filters.Soft(0.5)."
        )


class PlainDraw(AbstractDraw):
    """A draw by `scheme(key, weights, n) -> ancestors`, such as `numerics.systematic`; the weights after it are equal."""

    scheme: Callable = eqx.field(static=True, default=numerics.systematic)

    def __check_init__(self):
        check_scheme("resampling", self.scheme)

    def draw(self, key, weights, n):
        return self.scheme(key, weights, n)

    def split(self, logs):
        return jnp.zeros_like(logs), logs


class Soft(AbstractDraw):
    """A resampling scheme that draws from softened weights, `share` w + (1 - share) / N (P. Karkus, D. Hsu & W. Lee 2018).

    A drawn particle has the weight w over the softened weight, through which derivatives pass. The log-likelihood is
    right for any share, but noisier. With `gradient="held"` the derivative of the draw itself is left out: a **bias** that falls
    with the share (with 0 there is no choice at all, and weights degenerate). With `gradient="score"` there is no bias.
    """

    reweights: ClassVar[bool] = True
    share: float = eqx.field(static=True, default=0.5)
    scheme: Callable = eqx.field(static=True, default=numerics.systematic)

    def __check_init__(self):
        check("Soft.share", self.share, lambda v: (v >= 0) & (v < 1), "at least 0 and below 1")
        check_scheme("Soft.scheme", self.scheme)

    def draw(self, key, weights, n):
        return self.scheme(key, self.share * weights + (1.0 - self.share) / weights.shape[0], n)

    def split(self, logs):
        soft = jnp.log(self.share * jnp.exp(logs) + (1.0 - self.share) / logs.shape[0])
        return logs - soft, soft


Scheme = AbstractResampling | Callable
"""The type of a particle filter's `resampling`."""


def as_resampling(scheme: Scheme) -> AbstractResampling:
    """The scheme itself, or a `PlainDraw` of a function `(key, weights, n) -> ancestors`. **Raises** `InputError` for others."""
    return scheme if isinstance(scheme, AbstractResampling) else PlainDraw(scheme)


def drawn_ancestors(scheme: AbstractDraw, key, weights, n: int):
    """Ancestors (n,) int32, without derivative, stored for the backward pass."""
    drawn = scheme.draw(key, jax.lax.stop_gradient(weights), n)
    return checkpoint_name(drawn.astype(jnp.int32), kit.KEPT)


def log_weights_after(scheme: AbstractDraw, logs, ancestors, gradient: str):
    """The log weights (n,), over 1 / n, of particles drawn by the log weights `logs` (N,): zero unless the scheme
    `reweights`. They carry the derivative of the choice unless `gradient` is "held".
    """
    after, chances = scheme.split(logs)
    after = after[ancestors]
    return after if gradient == "held" else after + score(chances[ancestors])


def choose_ancestors(filter_, key, weights):
    """Ancestors (N,) int32 and whether resampling took place (None: always, known when compiling)."""
    drawn = drawn_ancestors(filter_.scheme, key, weights, filter_.particles)
    if filter_.threshold >= 1:
        return drawn, None
    resampled = numerics.ess(weights) < filter_.threshold * filter_.particles
    return jnp.where(resampled, drawn, jnp.arange(filter_.particles, dtype=drawn.dtype)), resampled


def log_chosen(filter_, log_probabilities, ancestors):
    """The log weights (n,), over 1 / n, of particles that a filter's scheme drew with these log-probabilities (N,), with the
    derivative of the choice unless the filter's `gradient` is held."""
    return log_weights_after(filter_.scheme, log_probabilities, ancestors, filter_.gradient)


DRAW_INSTEAD = "Take numerics.systematic or Soft(...), or ParticleFilter, which takes any scheme."
"""The advice in the error of a filter that needs ancestors."""


def check_ancestors(who: str, scheme: Scheme, instead: str) -> None:
    """Raise `InputError` if the scheme's particles have no ancestors, which `who` needs; `instead` is the advice."""
    scheme = as_resampling(scheme)
    if not scheme.keeps_ancestors:
        raise InputError(
            f"{who}: particles of {type(scheme).__name__} have no ancestors: its class does not declare `keeps_ancestors`. "
            f"{instead}"
        )
