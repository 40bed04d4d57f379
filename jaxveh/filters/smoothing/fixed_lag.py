"""Fixed-lag smoothing: each row given the rows up to a lag after it, live or over a recording."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_whole
from jaxveh.filters.choosing import check_ancestors
from jaxveh.filters.outer_belief import AbstractOuterBelief
from jaxveh.filters.particle import ParticleBelief
from jaxveh.filters.smoothing.given_later import given_later
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate, smoothed_estimate
from jaxveh.filters.wrappers.base import gaussian_of
from jaxveh.statespace import AbstractFilter, AbstractWrapper, Gradient, Row, Smoothing, StateSpace, kit


class LaggedBelief(AbstractOuterBelief):
    """The newest belief `inside`; `past`: the last beliefs as one with (lag + 1, ...) leaves, oldest first; `shown`:
    mean and standard deviation of the report of the oldest, given all rows up to the newest."""

    inside: Any
    past: Any
    shown: Any

    def moments(self, model):
        return self.shown


class FixedLag(AbstractWrapper):
    """`inner`, whose estimate is that of the row `lag` rows back given all rows so far; in the first rows, of the first row.

    A live smoother of constant memory, for estimates that may be `lag` rows late but should be more accurate. Gaussian
    filters go back by their own Rauch-Tung-Striebel steps, particle filters by their ancestors (G. Kitagawa 1996), of
    which there are still many over a short lag. The info is that of the filter. A step costs `lag` backward steps.

    `smooth(filter, model, recording, lag=...)` does the same and puts each row's estimate at its own time.
    """

    noise_by_row: ClassVar[bool] = True
    inner: AbstractFilter
    lag: int = eqx.field(static=True)

    @property
    def gradients(self):
        return Gradient.exact

    def __check_init__(self):
        super().__check_init__()
        check_lag(self.inner, self.lag)

    def check(self, model):
        self.inner.check(model)

    def _init(self, model, row, key):
        belief, info = self.inner._init(model, row, key)
        past = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (self.lag + 1, *jnp.shape(leaf))), belief)
        return LaggedBelief(belief, past, belief.moments(model)), info

    def _step(self, model, belief, row):
        inside, info = self.inner._step(model, belief.inside, row)
        longer = lambda past, new: jnp.concatenate([past[1:], new[None]])
        past = jax.tree.map(longer, belief.past, inside)
        # Until there are lag + 1 rows, the oldest beliefs are copies of the first.
        real = jnp.arange(self.lag, dtype=jnp.int32) >= self.lag + 1 - inside.count
        return LaggedBelief(inside, past, first_of(self.inner, model, past, real)), info


def check_lag(filter: Any, lag: int) -> None:
    """Raise `InputError` unless the lag is a whole number of at least 1 and the filter has a smoother."""
    check_whole("lag", lag)
    kind = kit.check_smooths("FixedLag", filter)
    if kind is Smoothing.particles:
        check_ancestors("FixedLag", kit.innermost(filter).resampling, "Take numerics.systematic or Soft(...).")


def first_of(filter: Any, model: StateSpace, past: Any, real: Any) -> tuple[Any, Any]:
    """Mean and standard deviation of the report of the first of the `past` beliefs, leaves (L + 1, ...), given the last.

    A belief that is not `real` (L,) is skipped: it is a copy of the one after it.
    """
    if kit.smoothing_of(filter) is Smoothing.particles:
        return _trace_ancestors(model, past, real)
    last = jax.tree.map(lambda leaf: leaf[-1], past)
    before = jax.tree.map(lambda leaf: leaf[:-1], past)
    after = past.t[1:], jax.tree.map(lambda leaf: leaf[1:], past.u)

    def back(later, given):
        belief, (t, u), counts = given
        found = given_later(filter, model, belief, t, u, later)
        return jax.tree.map(lambda a, b: jnp.where(counts, a, b), found, later), None

    first, _ = jax.lax.scan(jax.checkpoint(back), gaussian_of(last), (before, after, real), reverse=True)
    return first.moments(model)


def _trace_ancestors(model: StateSpace, past: ParticleBelief, real: Any) -> tuple[Any, Any]:
    """The result of `first_of` by the ancestors of the last particles."""
    weights = past.weights[-1]
    lines = jnp.arange(weights.shape[0], dtype=past.ancestors.dtype)

    def back(lines, given):
        parents, counts = given
        return jnp.where(counts, parents[lines], lines), None

    lines, _ = jax.lax.scan(back, lines, (past.ancestors[1:], real), reverse=True)
    particles = jax.tree.map(lambda field: field[0][lines], past.particles)
    t, u = past.t[0], jax.tree.map(lambda leaf: leaf[0], past.u)
    return ParticleBelief(particles, weights, None, None, t, u, None).moments(model)


@eqx.filter_jit
def smooth_with_lag(filter: Any, model: StateSpace, rows: Row, key, lag: int) -> SmoothedEstimate:
    """The estimate of each row given the rows up to `lag` rows later; `rows` has (T,) leaves."""
    filtered, beliefs = kit.scan_and_keep(filter, model, rows, key, lambda belief: belief)
    count = rows.t.shape[0]

    def window(k):
        # After the end there are copies of the last row, which are not counted.
        place = jnp.minimum(k + jnp.arange(lag + 1), count - 1)
        past = jax.tree.map(lambda leaf: leaf[place], beliefs)
        return first_of(filter, model, past, k + jnp.arange(lag) < count - 1)

    return smoothed_estimate(model, filtered, jax.lax.map(window, jnp.arange(count)))
