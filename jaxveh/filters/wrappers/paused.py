"""A filter that waits while its model does not hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_positive
from jaxveh._core.names import check_names
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, with_spread
from jaxveh.statespace import StateSpace
from jaxveh.statespace.contract import AbstractFilter, always, apart


class Paused(AbstractFilter):
    """`filter`, held while the input `channel` is above 0.5: no prediction, no measurement, as estimators of mass and
    grade wait while braking.

    The channel holds from its row to the next, whatever the model's `input_path`: the time before a pause's first row is still
    predicted, that before the first row after it is not. Meanwhile the state stays what it was. In the first row after a pause
    its spread grows by `widen`, standard deviations by state: what may have happened (`{"v_x": 20.0}`: whatever it was, the
    next measurement says it anew). Infos of rows in a pause have a log-likelihood of zero and no innovation.
    """

    filter: AbstractRuleFilter
    channel: str = eqx.field(static=True)
    widen: tuple[tuple[str, float], ...] = eqx.field(static=True)

    def __init__(self, filter: AbstractRuleFilter, channel: str, widen: Mapping[str, float]):
        self.filter, self.channel, self.widen = filter, channel, tuple(sorted(dict(widen).items()))

    def __check_init__(self):
        check_kind("Paused", self.filter, AbstractRuleFilter)
        for name, spread in self.widen:
            check_positive(f"Paused.widen of {name}", spread)

    def check(self, model):
        self.filter.check(model)
        check_names("Paused.channel", (self.channel,), model.inputs)
        check_names("Paused.widen", [name for name, _ in self.widen], model.states)

    def init(self, model, row, key=None):
        del key
        return apart(self._init, always(row.t), model, row)

    def _init(self, model, row):
        prior = self.filter.prior(model, row)
        return self.filter.update(model, prior, self._silent(model, row))

    def step(self, model, belief, row):
        return apart(self._step, belief.count >= 0, model, belief, row)

    def _step(self, model, belief, row):
        paused = getattr(row.u, self.channel) > 0.5
        was = getattr(belief.u, self.channel) > 0.5
        wide = eqx.tree_at(lambda b: b.t, self._widened(model, belief), row.t)
        ahead = self.filter.predict_between(model, belief, row.t, row.u)
        held = with_spread(belief, belief.vector, self.filter.form.start(belief.covariance), t=row.t)
        start = _choose(was, _choose(paused, held, wide), ahead)
        return self.filter.update(model, start, self._silent(model, row))

    def _silent(self, model, row):
        """The row, without measurements while paused."""
        paused = getattr(row.u, self.channel) > 0.5
        return row._replace(y=jax.tree.map(lambda value: jnp.where(paused, jnp.nan, value), row.y))

    def _widened(self, model: StateSpace, belief: Any) -> Any:
        extra = dict(self.widen)
        dtype = belief.vector.dtype
        added = jnp.diag(jnp.asarray([extra.get(name, 0.0) ** 2 for name in model.states], dtype))
        return with_spread(belief, belief.vector, self.filter.form.start(belief.covariance + added))


def _choose(condition: Any, a: Any, b: Any) -> Any:
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)
