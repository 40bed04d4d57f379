"""Look-aheads of an auxiliary particle filter: the likelihood of the next measurement before particles have moved."""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.parts import check_static
from jaxveh._core.result import Result, code
from jaxveh.filters.gaussian.filter import check_gaussian, kind_of_law
from jaxveh.filters.particle import log_prob
from jaxveh.statespace import AbstractNoise, Gaussian, StateDependent, StateSpace, kit

MISLED = 0.5
"""The look-ahead misled if the effective sample size is below this share of the one that a choice by the weights alone gives."""


def _check_defensive(lookahead) -> None:
    check(
        f"{type(lookahead).__name__}.defensive",
        lookahead.defensive,
        lambda s: (s >= 0) & (s < 1),
        "at least 0, below 1",
    )


class AbstractLookahead(eqx.Module):
    """The first stage of an `AuxiliaryParticleFilter`: an approximation of p(y_k | x_{k-1}) before the draw.

    `defensive`: the share of ancestors that are drawn by their weights alone (T. Hesterberg 1995, a defensive mixture), so that
    no second-stage weight exceeds the likelihood by more than a factor of 1 / share, however wrong the look-ahead is.
    """

    # No postponed annotations in this file: they would turn this into a field.
    defensive: eqx.AbstractVar[float]

    def __check_init__(self):
        check_static(self)

    @abc.abstractmethod
    def check(self, model: StateSpace) -> None:
        """Raise `InputError` if the model does not meet this look-ahead's needs."""

    @abc.abstractmethod
    def log_prob(self, model: StateSpace, row, ahead, dt) -> tuple[Any, dict]:
        """For particles `ahead` ((N,) in each field), approximately log p(y | x_{k-1}) (N,), and the residuals there by
        channel."""

    def propagate(self, model: StateSpace, t0, t1, x, u) -> Any:
        """The point at which each particle of the state `x` (N,) is judged: its transition without noise."""
        return model.transition(t0, t1, x, u)

    @property
    def moves_by_transition(self) -> bool:
        """Whether `propagate` is the transition, which is then computed only once."""
        return True


class PredictiveLikelihood(AbstractLookahead):
    """The likelihood of the next measurement given the particle, its process noise included: N(y; h(mu), H Q H^T + R).

    mu is the transition without noise and H the observation's slope there with respect to the fields with noise (forward mode,
    one derivative per field). It is exact for a linear observation (M. Pitt & N. Shephard 1999, sec. 3.2), and never sharper
    than the process noise allows; the second stage only corrects the error of the linearisation. Where the observation is so
    nonlinear that this error is large (such as a square at zero), the `defensive` ancestors keep the filter near the bootstrap
    filter. Process and measurement noise must be Gaussian; measurement noise that depends on the state is taken at mu.
    """

    defensive: float = eqx.field(static=True, default=0.3)

    def __check_init__(self):
        _check_defensive(self)

    def check(self, model):
        if model.process_noise is None:
            raise InputError("PredictiveLikelihood: the model has no process noise. Use PointLookahead.")
        advice = "Use PointLookahead."
        check_gaussian("PredictiveLikelihood", "process noise", model.process_noise.law, advice)
        check_gaussian("PredictiveLikelihood", "measurement noise", kind_of_law(model), advice)

    def log_prob(self, model, row, ahead, dt):
        measured, present = kit.presence(model, row)
        law, R = noises(model, row, ahead, dt)
        seen, slopes = slopes_of(model, row, ahead, law.names)
        residual = {name: measured[name] - value for name, value in zip(model.channels, seen, strict=True)}
        for name in model.angles:
            residual[name] = numerics.wrap_angle(residual[name])
        here = [present[name] for name in model.channels]
        filled = [jnp.where(h, residual[name], 0.0) for h, name in zip(here, model.channels, strict=True)]
        spread = _marginal(_image(law, slopes), R, here)
        count = sum(h.astype(R.dtype) for h in here)
        logs = _log_normal(spread, filled) - 0.5 * kit.LOG_2PI * count
        return numerics.fence(logs), residual


class PointLookahead(AbstractLookahead):
    """The likelihood p(y_k | mu_k) at one point of each particle's prediction, as in the papers (Pitt & Shephard 1999, eq. 8).

    `characteristic(model, t0, t1, x, u) -> mu`, elementwise, is that point; None: the transition without noise. It
    takes the point as exact: **where the measurement noise is smaller than the effect of the process noise, it chooses
    the few ancestors whose points happen to be near, and the likelihood is far too low** (measurement noise a fifth of
    a step's process noise, 1000 particles: log-likelihood one unit per row too low). `defensive` bounds the harm.
    """

    characteristic: Callable | None = eqx.field(static=True, default=None)
    defensive: float = eqx.field(static=True, default=0.0)

    def __check_init__(self):
        _check_defensive(self)

    def check(self, model):
        del model

    def log_prob(self, model, row, ahead, dt):
        return log_prob(model, row, ahead)

    def propagate(self, model, t0, t1, x, u):
        if self.characteristic is None:
            return model.transition(t0, t1, x, u)
        return self.characteristic(model, t0, t1, x, u)

    @property
    def moves_by_transition(self):
        return self.characteristic is None


WITHOUT_SLOPES = PointLookahead(defensive=0.5)
"""For models whose noises are not Gaussian."""


def lookahead_for(model: StateSpace) -> AbstractLookahead:
    """The default look-ahead: with the process noise if both noises are Gaussian."""
    if model.process_noise is not None and model.process_noise.law.is_gaussian and kind_of_law(model).is_gaussian:
        return PredictiveLikelihood()
    return WITHOUT_SLOPES


def soften(ahead: Any, log_weights: Any, alive: Any, share: float) -> Any:
    """The log look-ahead (N,) where a `share` of ancestors is drawn without it: log(share + (1 - share) ahead / mean ahead)."""
    if share == 0:
        return ahead
    _, log_mean, some = numerics.normalise(jnp.where(alive, ahead + log_weights, -jnp.inf))
    mean = jnp.where(some, log_mean + jnp.log(jnp.asarray(ahead.shape[0], ahead.dtype)), 0.0)
    log_share = jnp.log(jnp.asarray(share, ahead.dtype))
    return jnp.logaddexp(log_share, jnp.log1p(-jnp.asarray(share, ahead.dtype)) + (ahead - mean))


def remark_of(weights: Any, log_drawn: Any) -> Any:
    """`Result.lookahead_misled` if the look-ahead misled, otherwise zero.

    With v the second-stage weights and `log_drawn` the logarithm of how much more often each ancestor was drawn than by its
    weight alone, the effective sample size over the one without look-ahead is about sum v^2 drawn / sum v^2, both of the same
    particles. It is low where the heavy particles come from ancestors that the look-ahead had judged unlikely.
    """
    weights, drawn = jax.lax.stop_gradient((weights, jnp.exp(jnp.minimum(log_drawn, 50.0))))
    squared = jnp.square(weights)
    gain = numerics.total(squared * drawn) / numerics.total(squared)
    return jnp.where(gain < MISLED, code(Result.lookahead_misled), code(Result.successful))


def noises(model: StateSpace, row, particles, dt: Any) -> tuple[AbstractNoise, Any]:
    """The law of the process noise over `dt`, and the covariance of the measurement noise by channel: (m, m), or
    (m, m, N) if it depends on the particles' states."""
    assert model.process_noise is not None  # `PredictiveLikelihood.check` ensures it
    process = model.process_noise.over(dt)
    if not isinstance(model.measurement_noise, StateDependent):
        return process, model.measurement_noise.covariance()

    def at(x):
        law = model.measurement_law(row.t, x, row.u)
        place = jnp.asarray([law.names.index(name) for name in model.channels])
        return law.covariance()[place][:, place]

    return process, jax.vmap(at, out_axes=-1)(particles)


def slopes_of(model: StateSpace, row, particles, names: tuple[str, ...]) -> tuple[list, list]:
    """The observation of the particles, (N,) by channel, and its slopes with respect to the states `names`, (N,) by
    channel and state."""
    n = particles[0].shape[0]

    def see(x):
        observed = model.observation(row.t, x, row.u)
        return [jnp.broadcast_to(getattr(observed, name), (n,)) for name in model.channels]

    one = jnp.ones(n, particles[0].dtype)
    along = lambda name: jax.jvp(lambda v: see(particles._replace(**{name: v})), (getattr(particles, name),), (one,))[1]
    slopes = [list(row) for row in zip(*[along(name) for name in names], strict=True)]
    return numerics.fence((see(particles), slopes))


def _image(law: AbstractNoise, slopes: list) -> list[list]:
    """H Q H^T, as rows up to the diagonal, each entry (N,)."""
    if all(isinstance(part, Gaussian) for part in law.parts):
        variances = [jnp.square(std) for part in law.parts for std in part.std]
        weighted = [[v * slope for v, slope in zip(variances, of, strict=True)] for of in slopes]
    else:
        weighted = list(jnp.einsum("fg,cgn->cfn", law.covariance(), jnp.stack([jnp.stack(of) for of in slopes])))
    dot = lambda a, b: sum(x * y for x, y in zip(a, b, strict=True))
    return [[dot(weighted[i], slopes[j]) for j in range(i + 1)] for i in range(len(slopes))]


def _marginal(image: list[list], R: Any, here: list) -> list[list]:
    """image + R of the channels `here`; absent channels are independent and of unit variance."""
    entry = lambda i, j: jnp.where(here[i] & here[j], image[i][j] + R[i, j], 1.0 if i == j else 0.0)
    return [[entry(i, j) for j in range(i + 1)] for i in range(len(here))]


def _log_normal(lower: list[list], residual: list) -> Any:
    """-(r^T S^-1 r + log det S) / 2 (N,), for S as rows up to the diagonal: S = L D L^T, written out elementwise."""
    unit: list[list] = []  # rows of L left of the diagonal
    pivots: list = []
    white: list = []
    total = 0.0
    for entries, value in zip(lower, residual, strict=True):
        scaled: list = []  # the row of L D
        for j, entry in enumerate(entries[:-1]):
            scaled.append(entry - sum(s * below for s, below in zip(scaled, unit[j], strict=True)))
        row = [s / pivot for s, pivot in zip(scaled, pivots, strict=True)]
        pivot = entries[-1] - sum(s * r for s, r in zip(scaled, row, strict=True))
        z = value - sum(r * w for r, w in zip(row, white, strict=True))
        total = total + jnp.square(z) / pivot + numerics.log(pivot)
        unit.append(row)
        pivots.append(pivot)
        white.append(z)
    return -0.5 * total
