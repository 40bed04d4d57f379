"""Kalman filter and smoother as associative scans over all rows at once; the time grows with the logarithm of the
number of rows."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.result import Result, with_reason
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import innovation_info, observation_image, transition_image, wrapped_innovation
from jaxveh.filters.gaussian.forms import masked_factor
from jaxveh.filters.gaussian.iterated import line_through
from jaxveh.filters.gaussian.noises import covariance_in, law_at
from jaxveh.filters.gaussian.rules import AbstractRule, product
from jaxveh.statespace import Row, StateSpace, kit


class Lines(NamedTuple):
    """Linear approximations with errors of a function of the state, one per row: `slope` (T, m, n), `offset` (T, m),
    covariance `error` (T, m, m)."""

    slope: Any
    offset: Any
    error: Any


class Filtering(NamedTuple):
    """p(x_k | x_j, y_j+1..k) = N(A x_j + b, C) and p(y_j+1..k | x_j) ~ N(x_j; J^-1 eta, J^-1), with (T, ...) leaves."""

    A: Any
    b: Any
    C: Any
    eta: Any
    J: Any


class SmoothingElement(NamedTuple):
    """p(x_k | x_j, y_0..j) = N(E x_j + g, L) for an earlier row k and a later row j, with (T, ...) leaves."""

    E: Any
    g: Any
    L: Any


class Passed(NamedTuple):
    """Means (T, n) and covariances (T, n, n) of all rows: predicted, filtered, smoothed; the means `about` (T, n) at
    which the model was linearised; and the `lines` of the observation."""

    predicted: tuple[Any, Any]
    filtered: tuple[Any, Any]
    smoothed: tuple[Any, Any]
    about: Any
    lines: Lines


def pass_over(
    rule: AbstractRule, model: StateSpace, rows: Row, means: Any, covariances: Any, *, complete: bool = False
) -> Passed:
    """Filter and smoother of the model linearised under N(means, covariances) in every row; `complete`: nothing in `rows` is
    missing.

    S. Sarkka & A. Garcia-Fernandez, Temporal parallelization of Bayesian smoothers, IEEE Trans. Automatic Control 66 (2021).
    """
    moves, sees = _lines(rule, model, rows, means, covariances, complete)
    about = means
    y, R = _measurements(model, rows, about, complete)
    if model.angles:
        # A measured angle is taken in the turn that is nearest to the linearised prediction.
        seen = jnp.einsum("tmn,tn->tm", sees.slope, means) + sees.offset
        y = seen + wrapped_innovation(model, (y - seen).T, jnp.ones((*y.shape[1:], 1), bool)).T
    R = R + sees.error
    prior = jnp.stack(model.prior.mean), model.prior.covariance()
    elements = _filtering_elements(moves, sees, y, R, prior)
    found = jax.lax.associative_scan(jax.vmap(_join_filtering), elements)
    filtered = found.b, numerics.symmetric(found.C)
    means, covariances = (leaf[:-1] for leaf in filtered)
    predicted = jax.vmap(_propagate)(moves, means, covariances)
    back = jax.vmap(_smoothing_element)(moves, means, covariances, *predicted)
    last = SmoothingElement(jnp.zeros_like(filtered[1][-1]), filtered[0][-1], filtered[1][-1])
    back = jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), back, last)
    joined = jax.lax.associative_scan(jax.vmap(_join_smoothing), back, reverse=True)
    predicted = jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), prior, predicted)
    return Passed(predicted, filtered, (joined.g, numerics.symmetric(joined.L)), about, sees)


def _presence(model, row, complete: bool):
    """`kit.presence`. Where all is there it does not depend on the measurements: a batch of runs has the same covariances."""
    values, present = kit.presence(model, row)
    return values, dict.fromkeys(present, jnp.asarray(True)) if complete else present


def gaussian_at(model: StateSpace, rule: AbstractRule, row: Row, mean: Any, covariance: Any) -> GaussianBelief:
    """The belief of this mean (n,) and covariance (n, n) at a row."""
    factor = numerics.cholesky(covariance)
    return GaussianBelief(mean, factor, covariance, row.t, row.u, jnp.int32(0), type(model.prior.mean), rule)


def _lines(rule, model, rows: Row, means, covariances, complete) -> tuple[Lines, Lines]:
    """The lines of the transitions (T - 1), whose errors include the process noise, and those of the observations (T)."""
    belief = lambda row, mean, covariance: gaussian_at(model, rule, row, mean, covariance)

    def move(row, t, u, mean, covariance):
        now = belief(row, mean, covariance)
        line = _line(transition_image(model, now, t, u), now)
        if model.process_noise is None:
            return line
        noise = covariance_in(model.process_noise.over(t - row.t), model.states, mean.dtype)
        return line._replace(error=line.error + noise)

    def see(row, mean, covariance):
        now = belief(row, mean, covariance)
        return _line(observation_image(model, now, row, _presence(model, row, complete)[1]), now)

    before = jax.tree.map(lambda leaf: leaf[:-1], (rows, means, covariances))
    moves = jax.vmap(move)(before[0], rows.t[1:], jax.tree.map(lambda u: u[1:], rows.u), *before[1:])
    return moves, jax.vmap(see)(rows, means, covariances)


def _line(image, belief) -> Lines:
    slope, rest = line_through(image, belief.factor)
    return Lines(slope, image.mean - slope @ belief.vector, product(rest, rest, image.signs))


def _measurements(model, rows: Row, means, complete):
    """Measurements (T, m), zero where missing, and noise covariances (T, m, m), of unit variance where missing. Noise
    that depends on the state is taken at the `means` (T, n)."""
    kind = type(model.prior.mean)

    def of(row, mean):
        values, present = _presence(model, row, complete)
        here = jnp.stack([present[name] for name in model.channels])
        law = law_at(model, row, lambda: kind(*mean))
        noise = masked_factor(law, model.channels, here, row.t.dtype)
        return jnp.stack([values[name] for name in model.channels]), noise @ noise.T

    return jax.vmap(of)(rows, means)


def _filtering_elements(moves: Lines, sees: Lines, y, R, prior) -> Filtering:
    def first(see, y, R):
        m, P = prior
        S = see.slope @ P @ see.slope.T + R
        K = jnp.linalg.solve(S, see.slope @ P).T
        zero = jnp.zeros_like(P)
        return Filtering(zero, m + K @ (y - see.slope @ m - see.offset), P - K @ S @ K.T, jnp.zeros_like(m), zero)

    def later(move, see, y, R):
        F, H = move.slope, see.slope
        S = H @ move.error @ H.T + R
        K = jnp.linalg.solve(S, H @ move.error).T
        keeps = jnp.eye(F.shape[0], dtype=F.dtype) - K @ H
        error = y - H @ move.offset - see.offset
        whitened = jnp.linalg.solve(S, H @ F).T
        return Filtering(keeps @ F, move.offset + K @ error, keeps @ move.error, whitened @ error, whitened @ H @ F)

    at = lambda tree, k: jax.tree.map(lambda leaf: leaf[k], tree)
    start = first(at(sees, 0), y[0], R[0])
    rest = jax.vmap(later)(moves, at(sees, slice(1, None)), y[1:], R[1:])
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, rest)


def _join_filtering(i: Filtering, j: Filtering) -> Filtering:
    """Join an earlier element i and a later element j (eq 15 and lemma 8 of the paper)."""
    # C and J are symmetric: the transpose of this inverse is that of I + J C.
    inverse = jnp.linalg.inv(jnp.eye(i.C.shape[0], dtype=i.C.dtype) + i.C @ j.J)
    forward, backward = j.A @ inverse, (inverse @ i.A).T
    return Filtering(
        A=forward @ i.A,
        b=forward @ (i.b + i.C @ j.eta) + j.b,
        C=forward @ i.C @ j.A.T + j.C,
        eta=backward @ (j.eta - j.J @ i.b) + i.eta,
        J=backward @ j.J @ i.A + i.J,
    )


def _propagate(move: Lines, m, P):
    return move.slope @ m + move.offset, numerics.symmetric(move.slope @ P @ move.slope.T + move.error)


def _smoothing_element(move: Lines, m, P, m_next, P_next) -> SmoothingElement:
    E = jnp.linalg.solve(P_next, move.slope @ P).T
    return SmoothingElement(E, m - E @ m_next, P - E @ P_next @ E.T)


def _join_smoothing(j: SmoothingElement, i: SmoothingElement) -> SmoothingElement:
    """Join a later element j and an earlier element i, in the order of a reversed scan."""
    return SmoothingElement(i.E @ j.E, i.E @ j.g + i.g, i.E @ j.L @ i.E.T + i.L)


def info_of(model: StateSpace, rows: Row, passed: Passed, *, complete: bool = False) -> Any:
    """The info (T,) of all rows: the measurements beside their predictions; `complete` as for `pass_over`."""
    y, R = _measurements(model, rows, passed.about, complete)

    def of(row, y, R, mean, covariance, line):
        _, present = _presence(model, row, complete)
        here = jnp.stack([present[name] for name in model.channels])
        innovation = wrapped_innovation(model, y - line.slope @ mean - line.offset, here)
        factor = numerics.cholesky(line.slope @ covariance @ line.slope.T + line.error + R)
        white = numerics.solve_lower(factor, innovation)
        lost = ~jnp.all(jnp.isfinite(factor))
        result = with_reason(kit.input_result(model, row), lost, Result.not_positive_definite)
        return innovation_info(model, row, innovation, white, factor, result)

    return jax.vmap(of)(rows, y, R, *passed.predicted, passed.lines)
