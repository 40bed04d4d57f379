"""How an auxiliary particle filter judges particles by the next measurement, before they have moved."""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.result import Result, code
from jaxveh.filters.gaussian.filter import check_gaussian, kind_of_law
from jaxveh.filters.particle import log_prob
from jaxveh.statespace import AbstractNoise, Gaussian, StateDependent, StateSpace, kit

MISLED = 0.5
"""Below this share of the effective sample size that a choice by the weights alone would have left, looking ahead misled."""


def _check_defensive(lookahead) -> None:
    check(
        f"{type(lookahead).__name__}.defensive",
        lookahead.defensive,
        lambda s: (s >= 0) & (s < 1),
        "at least 0, below 1",
    )


class AbstractLookahead(eqx.Module):
    """The first stage of an `AuxiliaryParticleFilter`: p(y_k | x_{k-1}), as far as one can know it before the draw.

    `defensive`: the share of ancestors that are drawn by their weights alone (T. Hesterberg 1995, a defensive mixture), so that
    no second-stage weight exceeds the likelihood by more than 1 / share, however wrong the look-ahead is.
    """

    # No postponed annotations in this file: they would make a field of it.
    defensive: eqx.AbstractVar[float]

    @abc.abstractmethod
    def check(self, model: StateSpace) -> None:
        """Raise `InputError` where the model has not what this needs."""

    @abc.abstractmethod
    def log_prob(self, model: StateSpace, row, ahead, dt) -> tuple[Any, dict]:
        """Of particles `ahead` ((N,) in each field), about log p(y | x_{k-1}) (N,), and the residuals there by channel."""

    def propagate(self, model: StateSpace, t0, t1, x, u) -> Any:
        """Where each particle of the state `x` (N,) is judged: its transition without noise."""
        return model.transition(t0, t1, x, u)

    @property
    def moves_by_transition(self) -> bool:
        """Whether `propagate` is the transition, which then is not computed twice."""
        return True


class PredictiveLikelihood(AbstractLookahead):
    """The likelihood of the next measurement given the particle, its process noise included: N(y; h(mu), H Q H^T + R).

    mu is the transition without noise and H the observation's slope there by the fields that carry noise (forward mode, one
    derivative a field). Exact for a linear observation (M. Pitt & N. Shephard 1999, sec. 3.2), and never sharper than what
    the noise leaves of it; the second stage only corrects what the slope leaves out. Where the observation is so nonlinear that
    the slope leaves out much (a square at its foot), the `defensive` ancestors keep the filter near the bootstrap filter.
    Process and measurement noise must be Gaussian; measurement noise that depends on the state counts as it is at mu.
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
    """The likelihood p(y_k | mu_k) at one point of each particle's future, as the papers print it (Pitt & Shephard 1999, eq. 8).

    `characteristic(model, t0, t1, x, u) -> mu`, elementwise, is that point; None: the transition without noise. It takes the
    point for certain: **where sensors are sharper than the process noise moves the particles, it chooses a few ancestors that
    happen to come near, and the likelihood is far too low** (sensors of a fifth of a step's noise, 1000 particles: by one
    unit of its logarithm a row). `defensive` bounds the harm.
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
    """What looks ahead where nothing is asked for: with the process noise where both noises are Gaussian."""
    if model.process_noise is not None and model.process_noise.law.is_gaussian and kind_of_law(model).is_gaussian:
        return PredictiveLikelihood()
    return WITHOUT_SLOPES


def soften(ahead: Any, log_weights: Any, alive: Any, share: float) -> Any:
    """Log look-ahead (N,) of which a `share` of ancestors knows nothing: log(share + (1 - share) ahead / mean ahead)."""
    if share == 0:
        return ahead
    _, log_mean, some = numerics.normalise(jnp.where(alive, ahead + log_weights, -jnp.inf))
    mean = jnp.where(some, log_mean + jnp.log(jnp.asarray(ahead.shape[0], ahead.dtype)), 0.0)
    log_share = jnp.log(jnp.asarray(share, ahead.dtype))
    return jnp.logaddexp(log_share, jnp.log1p(-jnp.asarray(share, ahead.dtype)) + (ahead - mean))


def remark_of(weights: Any, log_drawn: Any) -> Any:
    """Whether looking ahead misled: `Result.lookahead_misled` or zero.

    With v the second-stage weights and `log_drawn` how much more often each ancestor was drawn than by its weight alone, the
    effective sample size over the one without looking ahead is about sum v^2 drawn / sum v^2, both of the same particles:
    low where the heavy ones come from ancestors that had been thought little of.
    """
    weights, drawn = jax.lax.stop_gradient((weights, jnp.exp(jnp.minimum(log_drawn, 50.0))))
    squared = jnp.square(weights)
    gain = numerics.total(squared * drawn) / numerics.total(squared)
    return jnp.where(gain < MISLED, code(Result.lookahead_misled), code(Result.successful))


def noises(model: StateSpace, row, particles, dt: Any) -> tuple[AbstractNoise, Any]:
    """The law of the process noise over `dt`, and the covariance of the measurement noise by channel: (m, m), or (m, m, N) where
    it depends on the particles' states."""
    assert model.process_noise is not None  # `PredictiveLikelihood.check` has seen to it
    process = model.process_noise.over(dt)
    if not isinstance(model.measurement_noise, StateDependent):
        return process, model.measurement_noise.covariance()

    def at(x):
        law = model.measurement_law(row.t, x, row.u)
        place = jnp.asarray([law.names.index(name) for name in model.channels])
        return law.covariance()[place][:, place]

    return process, jax.vmap(at, out_axes=-1)(particles)


def slopes_of(model: StateSpace, row, particles, names: tuple[str, ...]) -> tuple[list, list]:
    """What the particles show, (N,) by channel, and its slopes by the states `names`: by channel, by state (N,)."""
    n = particles[0].shape[0]

    def see(x):
        observed = model.observation(row.t, x, row.u)
        return [jnp.broadcast_to(getattr(observed, name), (n,)) for name in model.channels]

    one = jnp.ones(n, particles[0].dtype)
    along = lambda name: jax.jvp(lambda v: see(particles._replace(**{name: v})), (getattr(particles, name),), (one,))[1]
    slopes = [list(row) for row in zip(*[along(name) for name in names], strict=True)]
    return numerics.fence((see(particles), slopes))


def _image(law: AbstractNoise, slopes: list) -> list[list]:
    """H Q H^T, by rows up to the diagonal, each entry (N,)."""
    if all(isinstance(part, Gaussian) for part in law.parts):
        variances = [jnp.square(std) for part in law.parts for std in part.std]
        weighted = [[v * slope for v, slope in zip(variances, of, strict=True)] for of in slopes]
    else:
        weighted = list(jnp.einsum("fg,cgn->cfn", law.covariance(), jnp.stack([jnp.stack(of) for of in slopes])))
    dot = lambda a, b: sum(x * y for x, y in zip(a, b, strict=True))
    return [[dot(weighted[i], slopes[j]) for j in range(i + 1)] for i in range(len(slopes))]


def _marginal(image: list[list], R: Any, here: list) -> list[list]:
    """image + R of the channels `here`; those absent are independent numbers of unit variance."""
    entry = lambda i, j: jnp.where(here[i] & here[j], image[i][j] + R[i, j], 1.0 if i == j else 0.0)
    return [[entry(i, j) for j in range(i + 1)] for i in range(len(here))]


def _log_normal(lower: list[list], residual: list) -> Any:
    """-(r^T S^-1 r + log det S) / 2 (N,), for S by rows up to the diagonal: S = L D L^T, written out elementwise."""
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
