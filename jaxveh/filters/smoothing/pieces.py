"""The Rauch-Tung-Striebel smoother of a long log, in pieces: only the beliefs of one piece are in memory at a time.

The filter runs twice, through all rows, and through each piece again before its way back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.filters.smoothing.given_later import given_later
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate, smoothed_estimate, with_last
from jaxveh.filters.wrappers.base import gaussian_of
from jaxveh.statespace import Row, StateSpace, kit


class Runs(NamedTuple):
    """One run, or several of which the first is the estimate. `over(function)`: a function of a run's values as one of all runs;
    `first`: the values of the first; `joined`: mean and standard deviation from those of all runs."""

    over: Callable
    first: Callable
    joined: Callable


ALONE = Runs(lambda function: function, lambda values: values, lambda moments: moments)


def smooth_in_pieces(filter: Any, model: StateSpace, rows: Row, runs: Runs, count: Any = None) -> SmoothedEstimate:
    """The smoother of the `runs`, whose `model` may have an axis for them, over rows with (T,) leaves, T >= 2; `count` as in
    `rauch_tung_striebel.rauch_tung_striebel`."""
    before, after = jax.tree.map(lambda leaf: leaf[0], rows), jax.tree.map(lambda leaf: leaf[1:], rows)

    def begin(model):
        belief, info = filter.init(model, before, None)
        return belief, kit.estimate_of_row(model, belief, info, kit.SHOWN)

    def in_form(form, piece):
        some = piece.rows._replace(t=piece.time), piece.there
        return lambda model, *values: kit.in_form_for_batches(form, filter, model, *some, *values)

    def back(later, belief, piece):
        later, shown, moments = runs.over(in_form(_back, piece))(model, belief, later)
        return later, (runs.first(shown), runs.joined(moments))

    ahead = lambda belief, piece: runs.over(in_form(_ahead, piece))(model, belief)
    start, shown = runs.over(begin)(model)
    later = None if count is None else count - 1
    last, (more, moments) = numerics.there_and_back(ahead, back, start, gaussian_of, after.t, after, later)
    at_end = runs.over(lambda model, belief: belief.moments(model))(model, last)
    shown = jax.tree.map(lambda one, rest: jnp.concatenate([one[None], rest]), runs.first(shown), more)
    one = runs.first(model)
    filtered = kit.estimate_of(one, rows.t, shown, runs.first(last), count)
    return smoothed_estimate(one, filtered, with_last(moments, runs.joined(at_end)))


def _ahead(filter: Any, model: StateSpace, rows: Row, there: Any, belief: Any, steps: kit.Steps) -> Any:
    """The belief after a piece, from the `belief` before it."""

    def body(belief, given):
        row, here = given
        return where(here, _next(filter, model, belief, row, steps)[0], belief), None

    return kit.scan_by(steps, body, belief, (rows, there))[0]


def _back(
    filter: Any, model: StateSpace, rows: Row, there: Any, belief: Any, later: Any, steps: kit.Steps
) -> tuple[Any, Any, Any]:
    """The smoothed Gaussian before a piece, from the `belief` before it and the smoothed Gaussian `later` of its last row; the
    filter's rows of the piece; and the smoothed moments of the row before each of them."""
    in_scalars = steps in (kit.Steps.written_out, kit.Steps.complete)
    kept = numerics.as_entries if in_scalars else lambda belief: belief
    whole = lambda kept: numerics.from_entries(kept, belief) if in_scalars else kept

    def ahead(belief, given):
        row, here = given
        after, info = _next(filter, model, belief, row, steps)
        return where(here, after, belief), (kept(belief), kit.estimate_of_row(model, after, info, kit.SHOWN))

    def back(later, given):
        belief, t, u, here = given
        found = where(here, given_later(filter, model, whole(belief), t, u, later), later)
        return found, found.moments(model)

    _, (before, shown) = kit.scan_by(steps, ahead, belief, (rows, there))
    later, moments = kit.scan_by(steps, back, later, (before, rows.t, rows.u, there), reverse=True)
    return later, shown, moments


def _next(filter: Any, model: StateSpace, belief: Any, row: Row, steps: kit.Steps) -> tuple[Any, Any]:
    told = model, belief, row
    return numerics.apart(filter._next, belief.count, *told) if steps is kit.Steps.whole else filter._next(*told)


def where(here: Any, one: Any, other: Any) -> Any:
    """The leaves of `one` where it is true, else those of the `other`."""
    return jax.tree.map(lambda one, other: jnp.where(here, one, other), one, other)
