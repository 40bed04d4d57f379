"""How the next particles are chosen, and how that choice lets derivatives through: by a score, or by softened weights."""

# No postponed annotations in this file: they would make fields of class variables.

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.ad_checkpoint import checkpoint_name

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.result import Result
from jaxveh.numerics import derivative_alone
from jaxveh.statespace import kit


def score(log_probability):
    """Zero, with all derivatives of a draw's log-probability: what makes gradients through a choice right.

    A draw j of a category i of probability p_i counts with p_i over the same p_i without derivative, a factor of 1, so that the
    expectation's derivative has the share that comes from choosing (A. Scibior & F. Wood, Differentiable particle filtering
    without modifying the forward pass, 2021; G. Poyiadjis, A. Doucet & S. Singh 2011).
    """
    return derivative_alone(log_probability)


def log_of(weights):
    """Log weights with -inf for zero, and zero instead of infinite gradients there; subnormal weights count as zero."""
    alive = weights >= jnp.finfo(weights.dtype).tiny
    return jnp.where(alive, jnp.log(jnp.where(alive, weights, 1)), -jnp.inf)


def gather(particles, ancestors):
    """The ancestors' states; the draw itself is held fixed under differentiation."""
    take = lambda field: field.at[ancestors].get(mode="promise_in_bounds", indices_are_sorted=True)
    return jax.tree.map(take, particles)


class Resampled(NamedTuple):
    """The next particles, (n,) in each field; which of those before each comes from, `ancestors` (n,) int32; the logarithms of
    their weights over 1 / n, with the derivative of the choice, `log_weights` (n,); and the code of how they came about, if there
    is anything to tell (`Result`)."""

    particles: Any
    ancestors: Any
    log_weights: Any
    remark: Any = Result.successful


class AbstractResampling(eqx.Module):
    """How the next particles are made of weighted ones.

    What a scheme can is declared where it is true, and is *no* otherwise:

    - `keeps_ancestors`: each of the next particles is a copy of one before, its ancestor, drawn by the weights alone (`draw`, as
      an `AbstractDraw` has it). Filters that choose ancestors before they move (`AuxiliaryParticleFilter`, `Guided`,
      `Marginalised`), and smoothers that follow them (`Genealogy`, `FixedLag`), ask for it.
    - `reweights`: the next particles have weights of their own, not all 1 / n.
    """

    keeps_ancestors: ClassVar[bool] = False
    reweights: ClassVar[bool] = False

    @abc.abstractmethod
    def resample(self, key, particles: Any, weights: Any, logs: Any, n: int, gradient: str) -> Resampled:
        """The next `n` of particles (N,) with normalised `weights` (N,), whose logarithms are `logs`; `gradient` as filters have
        it."""


class AbstractDraw(AbstractResampling):
    """A scheme that draws ancestors by the weights."""

    keeps_ancestors: ClassVar[bool] = True

    @abc.abstractmethod
    def draw(self, key, weights: Any, n: int) -> Any:
        """Ancestors (n,) int32, nondecreasing, of weights (N,)."""

    @abc.abstractmethod
    def split(self, logs: Any) -> tuple[Any, Any]:
        """Of normalised log weights (N,): the log weights after the draw, over 1 / n, and the log-probabilities of the draw."""

    def resample(self, key, particles, weights, logs, n, gradient):
        ancestors = drawn_ancestors(self, key, weights, n)
        chosen = log_weights_after(self, logs, ancestors, gradient)
        return Resampled(gather(particles, ancestors), ancestors, chosen)


class PlainDraw(AbstractDraw):
    """A draw by `scheme(key, weights, n) -> ancestors`, such as `numerics.systematic`; equal weights are left."""

    scheme: Callable = eqx.field(static=True, default=numerics.systematic)

    def draw(self, key, weights, n):
        return self.scheme(key, weights, n)

    def split(self, logs):
        return jnp.zeros_like(logs), logs


class Soft(AbstractDraw):
    """A resampling scheme that draws from softened weights, `share` w + (1 - share) / N (P. Karkus, D. Hsu & W. Lee 2018).

    Drawn particles keep the weight w over the softened one, through which derivatives pass; the log-likelihood stays right for
    any share, only noisier. With `gradient="held"` the derivative of the draw itself is left out: a **bias** that falls with
    the share (0: no choice at all, weights degenerate). With `gradient="score"` there is none.
    """

    reweights: ClassVar[bool] = True
    share: float = eqx.field(static=True, default=0.5)
    scheme: Callable = eqx.field(static=True, default=numerics.systematic)

    def __check_init__(self):
        check("Soft.share", self.share, lambda v: (v >= 0) & (v < 1), "at least 0 and below 1")

    def draw(self, key, weights, n):
        return self.scheme(key, self.share * weights + (1.0 - self.share) / weights.shape[0], n)

    def split(self, logs):
        soft = jnp.log(self.share * jnp.exp(logs) + (1.0 - self.share) / logs.shape[0])
        return logs - soft, soft


Scheme = AbstractResampling | Callable
"""What a particle filter takes as its `resampling`."""


def as_resampling(scheme: Scheme) -> AbstractResampling:
    """The scheme; a function `(key, weights, n) -> ancestors` as a `PlainDraw`."""
    return scheme if isinstance(scheme, AbstractResampling) else PlainDraw(scheme)


def drawn_ancestors(scheme: AbstractDraw, key, weights, n: int):
    """Ancestors (n,) int32, which no derivative passes, kept for the backward pass."""
    drawn = scheme.draw(key, jax.lax.stop_gradient(weights), n)
    return checkpoint_name(drawn.astype(jnp.int32), kit.KEPT)


def log_weights_after(scheme: AbstractDraw, logs, ancestors, gradient: str):
    """The log weights (n,), over 1 / n, of particles drawn from those of log weights `logs` (N,): zero unless the scheme
    `reweights`. They carry the derivative of the choice unless it is `held`.
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
"""What a filter says that needs ancestors."""


def check_ancestors(who: str, scheme: Scheme, instead: str) -> None:
    """Raise `InputError` for a scheme whose particles have no ancestors, which `who` needs, and say what to take `instead`."""
    scheme = as_resampling(scheme)
    if not scheme.keeps_ancestors:
        raise InputError(
            f"{who}: particles of {type(scheme).__name__} have no ancestors: its class does not declare any (`keeps_ancestors`). "
            f"{instead}"
        )
