"""The Rauch-Tung-Striebel smoother: backwards through a Gaussian filter's beliefs, each given all rows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.filters.gaussian import AbstractGaussianFilter
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.smoothing.given_later import given_later
from jaxveh.filters.smoothing.pieces import ALONE, Runs, smooth_in_pieces, where
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate, smoothed_estimate, with_last
from jaxveh.filters.wrappers.base import gaussian_of
from jaxveh.statespace import Row, StateSpace, kit


@eqx.filter_jit
def rauch_tung_striebel(
    filter: AbstractGaussianFilter, model: StateSpace, rows: Row, count: Any = None
) -> SmoothedEstimate:
    """The smoother of a Gaussian filter's kind over rows with (T,) leaves (Sarkka 2013, eqs 8.6, 9.17 and 10.1).

    `count`: how many of the rows, from the first on, are there, if not all (an integer array); what is shown of the others has no
    meaning.

    A long log is smoothed in pieces (`numerics.there_and_back`), which takes less memory and gives the same numbers except for
    rounding.
    """
    if numerics.pieces_of(len(rows.t)) > 1:
        return smooth_in_pieces(filter, model, rows, ALONE, count)
    return kit.in_form_for_batches(_smoothed_in_form, filter, model, rows, count)


@eqx.filter_jit
def smooth_together(
    filter: AbstractGaussianFilter, models: StateSpace, rows: Row, joined: Callable[[Any], Any], count: Any = None
) -> SmoothedEstimate:
    """The estimate of the first of several `models` on a leading axis (M,), whose rows are all smoothed in one batch; `count` as
    in `rauch_tung_striebel`.

    Its mean and standard deviation are `joined((means, stds))`: of the report of every model, fields of (M, ...), to fields of
    (...). A long log is smoothed in pieces, so that `joined` sees a piece at a time, and no more than the result is kept.
    """
    first = lambda tree: jax.tree.map(lambda leaf: leaf[0] if eqx.is_array(leaf) else leaf, tree)
    if numerics.pieces_of(len(rows.t)) > 1:
        return smooth_in_pieces(filter, models, rows, Runs(eqx.filter_vmap, first, joined), count)
    found = eqx.filter_vmap(lambda model: rauch_tung_striebel(filter, model, rows, count))(models)
    return smoothed_estimate(first(models), first(found.filtered), joined((found.mean, found.std)))


def _smoothed_in_form(
    filter: AbstractGaussianFilter, model: StateSpace, rows: Row, count: Any, steps: kit.Steps
) -> SmoothedEstimate:
    """The result of `rauch_tung_striebel` with `steps` of one form."""
    # Between two scans in scalars, a batch's matrices would be assembled and taken apart again. Without that, 64 unscented
    # smoothers of three states take 0.29 instead of 1.2 us per run and step (jax 0.10; 0.088 instead of 0.105 with 0.12).
    in_scalars = steps in (kit.Steps.written_out, kit.Steps.complete)
    kept = numerics.as_entries if in_scalars else lambda belief: belief
    filtered, beliefs = kit.scan_in_form(filter, model, rows, None, kept, kit.SHOWN, steps, count)
    whole = lambda belief: numerics.from_entries(belief, filtered.belief) if in_scalars else belief
    there = None if count is None else jnp.arange(1, len(rows.t)) < count
    last = whole(jax.tree.map(lambda leaf: leaf[-1], beliefs))
    before = jax.tree.map(lambda leaf: leaf[:-1], beliefs)
    after = jax.tree.map(lambda leaf: leaf[1:], (rows.t, rows.u))

    def back(later: GaussianBelief, given):
        belief, (t, u), here = given
        found = given_later(filter, model, whole(belief), t, u, later)
        found = found if here is None else where(here, found, later)
        return found, found.moments(model)

    _, moments = kit.scan_by(steps, back, gaussian_of(last), (before, after, there), reverse=True)
    return smoothed_estimate(model, filtered, with_last(moments, last.moments(model)))
