"""The unscented Kalman filter: sigma points as rows of a matrix, one row a field."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh._core.result import Result, code
from jaxveh.filters.base import (
    AbstractBelief,
    AbstractFilter,
    Info,
    always,
    apart,
    by_channel,
    input_result,
    presence,
    wrap_angle,
)
from jaxveh.numerics.sigma_points import unscented
from jaxveh.statespace import AbstractNoise, Gaussian, Row, StateSpace
from jaxveh.statespace.noise import LOG_2PI


class GaussianBelief(AbstractBelief):
    """A Gaussian over the state, named: vector (n,), covariance (n, n) and its lower Cholesky factor."""

    vector: jax.Array
    matrix: jax.Array
    factor: jax.Array
    t: Any
    u: Any
    count: Any
    state_type: Any = eqx.field(static=True)
    points: Any = eqx.field(static=True)

    @property
    def mean(self):
        """The state's mean (parameters on the real line), the state's NamedTuple."""
        return self.state_type(*self.vector)

    @property
    def std(self):
        """The state's standard deviations, the state's NamedTuple."""
        return self.state_type(*jnp.sqrt(jnp.diagonal(self.matrix)))

    @property
    def covariance(self):
        """(n, n) in the order of the state's fields."""
        return self.matrix

    def moments(self, model):
        if model.report_function is None:
            return self.mean, self.std
        dtype = self.vector.dtype
        shown = model.report(self.t, _states(self, self.state_type(*self.vector)), self.u)
        rows = _rows(shown, self.points.directions.shape[1])
        mean = _product(rows, jnp.asarray(self.points.mean_weights, dtype))
        spread = _product((rows - mean[:, None]) ** 2, jnp.asarray(self.points.covariance_weights, dtype))
        kind = type(shown)
        # A weight may be negative, so that rounding can leave a spread a little below zero.
        return kind(*mean), kind(*numerics.sqrt(jnp.maximum(spread, 0.0)))


def _states(belief: GaussianBelief, like):
    """The sigma points of a belief as a batch of states, (2n+1,) in each field."""
    directions = jnp.asarray(belief.points.directions, belief.vector.dtype)
    return type(like)(*(belief.vector[:, None] + _product(belief.factor, directions)))


def _rows(batch, count: int):
    """The fields of a batch as rows of a matrix; a field that does not depend on the state is repeated."""
    return jnp.stack([jnp.broadcast_to(field, (count,)) for field in batch])


def _product(a, b):
    """The matrix product (n, k) (k, m) or (n, k) (k,) as a sum that XLA fuses.

    Its library's products round differently with the place of the operands in memory, so that a live loop would not give
    the scan's bits; for few states they are slower, too.
    """
    return jnp.sum(a * b, axis=-1) if b.ndim == 1 else jnp.sum(a[:, None, :] * b.T[None], axis=-1)


def covariance_in(law: AbstractNoise, fields: tuple[str, ...], dtype):
    """A law's covariance in the order of `fields`, with zeros for fields that carry no noise: (n, n)."""
    if isinstance(law, Gaussian):
        std = law.std._asdict()
        variances = jnp.stack([std[name] ** 2 if name in std else jnp.zeros((), dtype) for name in fields])
        return jnp.where(jnp.eye(len(fields), dtype=bool), variances[:, None], jnp.zeros((), dtype))
    embed = jnp.asarray([[name == other for other in law.names] for name in fields], dtype)
    return _product(_product(embed, law.covariance()), embed.T)


class Unscented(AbstractFilter):
    """The unscented Kalman filter with additive noises and scaled weights (Julier & Uhlmann 2004; Sarkka 2013, sec. 5.6).

    `predict` and `update` are public, for sensors of different rates; the points are regenerated after the prediction,
    so that the update sees the process noise (on linear models this is the exact Kalman filter). The noises' laws
    must have covariances. Differentiable with respect to every array leaf of the model.
    """

    whitens: ClassVar[bool] = True
    alpha: float = eqx.field(static=True, default=1.0)
    beta: float = eqx.field(static=True, default=2.0)
    kappa: float = eqx.field(static=True, default=0.0)

    def check(self, model):
        laws = {"measurement noise": model.measurement_noise, "prior": model.prior.law}
        if model.process_noise is not None:
            laws["process noise"] = model.process_noise.law
        for what, law in laws.items():
            if not law.has_covariance:
                raise InputError(
                    f"Unscented: the {what} {type(law).__name__} has no covariance, which a Kalman filter needs. "
                    "Use a particle filter, or a Gaussian or Student-t law."
                )

    def _points(self, n: int) -> Any:
        return _static_points(n, self.alpha, self.beta, self.kappa)

    def init(self, model, row, key=None):
        del key
        return apart(self._init, always(row.t), model, row)

    def _init(self, model, row):
        covariance = model.prior.covariance()
        belief = GaussianBelief(
            vector=jnp.stack(model.prior.mean),
            matrix=covariance,
            factor=numerics.cholesky(covariance),
            t=row.t,
            u=row.u,
            count=jnp.int32(0),
            state_type=type(model.prior.mean),
            points=self._points(len(model.states)),
        )
        return self.update(model, belief, row)

    def predict(self, model: StateSpace, belief: GaussianBelief, t) -> GaussianBelief:
        """The belief at time `t`, propagated with the inputs that the belief carries (held)."""
        return self._predict(model, belief, t, belief.u)

    def _predict(self, model, belief, t, u_next):
        dtype, points = belief.vector.dtype, belief.points
        u = model.step_inputs(belief.t, t, belief.u, u_next)
        moved = model.transition(belief.t, t, _states(belief, belief.mean), u)
        rows = _rows(moved, points.directions.shape[1])
        mean = _product(rows, jnp.asarray(points.mean_weights, dtype))
        deviations = rows - mean[:, None]
        covariance = _product(deviations * jnp.asarray(points.covariance_weights, dtype), deviations.T)
        if model.process_noise is not None:
            covariance = covariance + covariance_in(model.process_noise.over(t - belief.t), model.states, dtype)
        return GaussianBelief(
            mean, covariance, numerics.cholesky(covariance), t, belief.u, belief.count, belief.state_type, points
        )

    def update(self, model: StateSpace, belief: GaussianBelief, row: Row) -> tuple[GaussianBelief, Info]:
        """The belief after the row's measurement, at the belief's own time (row.t is taken over, not propagated to)."""
        dtype, points = belief.vector.dtype, belief.points
        measured, present = presence(model, row)
        here = jnp.stack([present[name] for name in model.channels])
        batch = _states(belief, belief.mean)
        predicted = _channel_rows(model, model.observation(row.t, batch, row.u), points.directions.shape[1])
        predicted = jnp.where(here[:, None], predicted, 0)
        mean = _product(predicted, jnp.asarray(points.mean_weights, dtype))
        weights = jnp.asarray(points.covariance_weights, dtype)
        deviations = predicted - mean[:, None]
        states = _product(belief.factor, jnp.asarray(points.directions, dtype))
        noise = covariance_in(model.measurement_noise, model.channels, dtype)
        both = here[:, None] & here[None, :]
        # A missing channel becomes independent with unit variance and zero innovation: it changes nothing.
        spread = _product(deviations * weights, deviations.T)
        spread = spread + jnp.where(both, noise, jnp.eye(len(here), dtype=dtype))
        cross = _product(states * weights, deviations.T)
        innovation = jnp.stack([measured[name] for name in model.channels]) - mean
        innovation = jnp.where(here, _wrap(model, innovation), 0)
        factor = numerics.cholesky(spread)
        white = numerics.solve_lower(factor, innovation)
        gain = numerics.solve_lower(factor, cross.T)
        vector = belief.vector + _product(gain.T, white)
        covariance = belief.matrix - _product(gain.T, gain)
        nis = jnp.sum(white**2)
        count = jnp.sum(here.astype(dtype))
        log_likelihood = -0.5 * (nis + numerics.log_det(factor) + count * LOG_2PI)
        after = GaussianBelief(
            vector, covariance, numerics.cholesky(covariance), row.t, row.u, belief.count + 1, belief.state_type, points
        )
        info = Info(
            log_likelihood=log_likelihood,
            innovation=by_channel(model, innovation, present),
            innovation_std=by_channel(model, jnp.sqrt(jnp.diagonal(spread)), present),
            nis=nis,
            ess=jnp.full((), jnp.nan, dtype),
            whitened=record("Measurements", dict(zip(model.channels, white, strict=True))),
            log_scale=record("Measurements", dict(zip(model.channels, jnp.log(jnp.diagonal(factor)), strict=True))),
            result=_result(model, row, (belief, after), predicted, factor),
        )
        return after, info

    def step(self, model, belief, row):
        return apart(self._step, belief.count >= 0, model, belief, row)

    def _step(self, model, belief, row):
        return self.update(model, self._predict(model, belief, row.t, row.u), row)


def _channel_rows(model, observed, count: int):
    """Predicted measurements as rows in the order of the channels; angles unwrapped around the first point."""
    rows = []
    for name in model.channels:
        row = jnp.broadcast_to(getattr(observed, name), (count,))
        rows.append(row[0] + wrap_angle(row - row[0]) if name in model.angles else row)
    return jnp.stack(rows)


def _wrap(model, innovation):
    if not model.angles:
        return innovation
    wraps = jnp.asarray([name in model.angles for name in model.channels])
    return jnp.where(wraps, wrap_angle(innovation), innovation)


def _result(model, row, beliefs, predicted, factor):
    """The first thing that went wrong, in the order of the computation: what follows from it is not finite either."""
    before, after = beliefs
    diverged, indefinite = Result.non_finite_state, Result.not_positive_definite
    result = input_result(model, row)
    for values, reason in (
        (before.vector, diverged),
        (before.matrix, diverged),
        (before.factor, indefinite),
        (predicted, diverged),
        (factor, indefinite),
        (after.factor, indefinite),
    ):
        result = jnp.where((result == 0) & ~jnp.all(jnp.isfinite(values)), code(reason), result)
    return result


class _StaticPoints:
    """Sigma points as static data: equal by their defining numbers, so that jit sees one structure."""

    def __init__(self, n, alpha, beta, kappa):
        self._key = (n, alpha, beta, kappa)
        self.directions, self.mean_weights, self.covariance_weights = unscented(n, alpha, beta, kappa)

    def __eq__(self, other):
        return isinstance(other, _StaticPoints) and self._key == other._key

    def __hash__(self):
        return hash(self._key)


def _static_points(n, alpha, beta, kappa):
    return _StaticPoints(n, alpha, beta, kappa)
