"""A method's answers along a log: looking back only, as a car would give them, or smoothed by all rows."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_flags, is_concrete
from jaxveh._core.lengths import common_length, lengthen, lengthen_time, shorten
from jaxveh._core.recording import Recording, check_recording, time_for
from jaxveh.estimators.contract import check_needs
from jaxveh.estimators.method import AbstractMethod, AbstractSmoothable, Answer, Answers, dtype_of
from jaxveh.estimators.rear_steer import check_rear_angle
from jaxveh.estimators.sequential import Belief
from jaxveh.numerics import apart

CONTRADICTS = 3.0
"""Mean square of the news of later rows over their expected spread, by component, from which they contradict a row."""

LITTLE = 1e3
"""Epsilons that a correlation of 1 is increased by: rounding leaves less."""


def follow(who: str, method: AbstractMethod, recording: Recording, *, smoothed: bool = False) -> Answers:
    """A method's answers to all rows of a log; compiled once for each kind of method and common length
    (`jaxveh._core.lengths`), so that logs of similar length share a program. Each answer looks back only; with `smoothed` it
    uses all rows (`smooth_rows`).

    **Raises** `InputError` for channels that are missing, in other units, infinite, or not known in every row where they must
    be, and for a method that cannot be smoothed.
    """
    check_flags(smoothed=smoothed)
    if smoothed and not isinstance(method, AbstractSmoothable):
        raise InputError(
            f"{who}: smoothed: {type(method).__name__} looks back only. Leave smoothed out, or take the recommended "
            "method or another kit.AbstractSmoothable."
        )
    check_recording(who, recording)
    check_rear_angle(who, method, recording)
    there = [need for need in method.needs if not need.optional or need.channel in recording]
    check_needs(who, tuple(need._replace(optional=False) for need in there), recording)
    for need in there:
        _check_finite(who, need.channel, recording)
    said = _said(method, recording, [need.channel for need in there], smoothed)
    return Answers(recording.time, said.mean, said.std, said.known, said.result)


def _said(method: AbstractMethod, recording: Recording, there: list[str], smoothed: bool) -> Answer:
    """The answers from the channels that are `there`."""
    dtype, rows = dtype_of(method), len(recording)
    plain = is_concrete(method, recording)
    # What is concrete is prepared on the host, where nothing is compiled for its length.
    array = np.asarray if plain else jnp.asarray
    none = np.full(rows, np.nan, dtype)
    values = {need.channel: none for need in method.needs}
    values |= {name: array(recording[name]).astype(dtype) for name in there}
    time = array(time_for(recording, dtype)).astype(dtype)
    if not plain:
        return (smooth_rows if smoothed else follow_rows)(method, time, values)
    length = common_length(rows)
    time, values = lengthen_time(time, length), lengthen(values, length)
    said = smooth_rows(method, time, values, jnp.asarray(rows)) if smoothed else follow_rows(method, time, values)
    return shorten(said, rows)


def _check_finite(who: str, name: str, recording: Recording) -> None:
    if not is_concrete(recording[name]):
        return
    infinite = np.isinf(np.asarray(recording[name]))
    if infinite.any():
        raise InputError(
            f"{who}: channel {name} is infinite at t = {np.asarray(recording.time)[np.argmax(infinite)]:g} s: must be finite, or "
            "NaN where nothing was measured."
        )


@eqx.filter_jit
def follow_rows(method: AbstractMethod, time: Any, values: dict[str, Any]) -> Answer:
    """The compiled part of `follow`, for (T,) arrays; steps are checkpointed, so that long logs can be differentiated."""
    take = lambda rows: jax.tree.map(lambda leaf: leaf[rows], (time, values))
    start, rest = take(0), take(slice(1, None))
    memory, said = apart(method.first, start[0], *start)
    # The memory has the same types after each row as after the first.
    body = jax.checkpoint(lambda memory, row: apart(method.next, row[0], memory, *row))
    _, later = jax.lax.scan(body, memory, rest)
    return jax.tree.map(lambda a, b: jnp.concatenate([jnp.asarray(a)[None], b]), said, later)


@eqx.filter_jit
def smooth_rows(method: AbstractSmoothable, time: Any, values: dict[str, Any], count: Any = None) -> Answer:
    """`follow_rows`, but each answer uses all rows: the smoother of H. Rauch, F. Tung, C. Striebel (1965), extended, with the
    slopes at the filter's means (Sarkka 2013, sec. 9.1). What the memory holds beside the belief looks back only. `count`: how
    many of the rows, from the first on, are to be used, if not all; the answers to the others have no meaning."""
    take = lambda rows: jax.tree.map(lambda leaf: leaf[rows], (time, values))
    start, (times, rows) = take(0), take(slice(1, None))
    first, _ = apart(method.first, start[0], *start)
    turn = lambda memory: memory.belief
    if numerics.pieces_of(len(times)) == 1:
        later = len(times) if count is None else count - 1
        all_rows = numerics.Piece(times, rows, jnp.arange(len(times)) < later)
        last, memories = _forward(method, first, all_rows)
        _, said = _backward(method, turn(last), memories, all_rows)
    else:
        ahead = lambda memory, piece: _forward(method, memory, piece)[0]
        back = lambda later, memory, piece: _backward(method, later, _forward(method, memory, piece)[1], piece)
        last, said = numerics.there_and_back(
            ahead, back, first, turn, times, rows, None if count is None else count - 1
        )
    return jax.tree.map(lambda a, b: jnp.concatenate([a, jnp.asarray(b)[None]]), said, method.say(last))


def _forward(method: AbstractSmoothable, memory: Any, piece: numerics.Piece) -> tuple[Any, Any]:
    """The memory after a piece, and those before each of its rows."""

    def forward(memory, given):
        t, values, here = given
        after, _ = apart(method.next, t, memory, t, values)
        return _where(here, after, memory), memory

    return jax.lax.scan(jax.checkpoint(forward), memory, tuple(piece))


def _backward(method: AbstractSmoothable, later: Belief, memories: Any, piece: numerics.Piece) -> tuple[Belief, Answer]:
    """The smoothed belief before a piece, given that of its last row, `later`; and the answers to the row before each of its
    rows, from the `memories` there."""

    def back(later, given):
        memory, (t, values, here) = given
        belief = _where(here, apart(_given_later, t, method, memory, t, values, later), later)
        return belief, method.say(memory._replace(belief=belief))

    return jax.lax.scan(jax.checkpoint(back), later, (memories, tuple(piece)), reverse=True)


def _where(here: Any, one: Any, other: Any) -> Any:
    return jax.tree.map(lambda one, other: jnp.where(here, one, other), one, other)


def _given_later(method: AbstractSmoothable, memory: Any, t: Any, values: dict[str, Any], later: Belief) -> Belief:
    """The belief of a row, given the smoothed belief `later` of the next row, which has these values.

    Where `later` contradicts this row's belief, as after a spin that the model does not know, it counts as one of two
    possibilities, and the less the further off it is (`CONTRADICTS`)."""
    mean, covariance = memory.belief
    ahead = lambda mean, covariance: method.ahead(memory._replace(belief=Belief(mean, covariance)), t, values)
    slope = jax.jacfwd(lambda mean: ahead(mean, covariance).mean)(mean)
    predicted, noise = ahead(mean, covariance), ahead(mean, jnp.zeros_like(covariance)).covariance
    news = later.mean - predicted.mean
    solved = _solve(predicted.covariance, jnp.concatenate([slope @ covariance, news[:, None]], axis=1))
    gain, distance = solved[:, :-1].T, news @ solved[:, -1]
    share = 1.0 / jnp.maximum(distance / (CONTRADICTS * mean.shape[0]), 1.0)
    # As Joseph's form, positive however large the differences are.
    left = jnp.eye(mean.shape[0], dtype=mean.dtype) - gain @ slope
    told = left @ covariance @ left.T + gain @ (later.covariance + noise) @ gain.T
    shift = gain @ news
    spread = share * told + (1.0 - share) * (covariance + share * jnp.outer(shift, shift))
    return Belief(mean + share * shift, numerics.symmetric(spread))


def _solve(covariance: Any, b: Any) -> Any:
    """The solution X of `covariance X = b`; states may have no variance, or depend on each other.

    A little is added to the diagonal of the correlations, so that they have a factor; two refinements take its effect out again.
    """
    size = jnp.diagonal(covariance)
    scale = jnp.where(size > 0.0, 1.0 / numerics.sqrt(numerics.or_one(size, size > 0.0)), 0.0)[:, None]
    correlations, b = scale * covariance * scale.T, scale * b
    factor = numerics.cholesky(correlations + LITTLE * jnp.finfo(size.dtype).eps * jnp.eye(len(size), dtype=size.dtype))
    found = numerics.solve_psd(factor, b)
    for _ in range(2):
        found = found + numerics.solve_psd(factor, b - correlations @ found)
    return scale * found
