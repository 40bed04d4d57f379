"""A filter that is paused while its model does not hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_positive
from jaxveh._core.names import as_pairs, check_names
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, check_kind, with_spread
from jaxveh.filters.gaussian.forms import Spread
from jaxveh.filters.outer_belief import either
from jaxveh.filters.wrappers.base import gaussian_of, with_gaussian
from jaxveh.statespace import AbstractWrapper, Gradient, StateSpace, kit


class Paused(AbstractWrapper):
    """`inner`, paused while the input `channel` is above 0.5: no prediction and no update, as for estimators of mass
    and grade while braking.

    The channel's value holds from its row to the next, whatever the model's `input_path`: the step to the first row of
    a pause is still predicted, the step to the first row after it is not. During a pause the state and the memory of a
    wrapped filter do not change. In the first row after a pause, the covariance grows by `widen`, standard deviations
    by state, for the changes during the pause (`{"v_x": 20.0}`: large enough that the next measurement determines the
    speed anew). The info of a row in a pause has a log-likelihood of zero and no innovation.
    """

    whitens: ClassVar[bool] = True
    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    inner: AbstractGaussianFilter
    channel: str = eqx.field(static=True)
    widen: tuple[tuple[str, float], ...] = eqx.field(static=True)

    @property
    def gradients(self):
        return Gradient.exact

    def __init__(self, inner: AbstractGaussianFilter, channel: str, widen: Mapping[str, float]):
        self.inner, self.channel, self.widen = inner, channel, tuple(sorted(as_pairs(widen, "Paused.widen")))

    def __check_init__(self):
        check_kind("Paused", self.inner, AbstractGaussianFilter)
        for name, spread in self.widen:
            check_positive(f"Paused.widen of {name}", spread)

    def check(self, model):
        self.inner.check(model)
        check_names("Paused.channel", (self.channel,), model.inputs)
        check_names("Paused.widen", [name for name, _ in self.widen], model.states)

    def _init(self, model, row, key):
        prior = self.inner.prior(model, row)
        after, info = self.inner.update(model, prior, self._silent(row))
        return either(self._waits(row.u), _after(prior, row), after), info

    def _step(self, model, belief, row):
        waits, waited = self._waits(row.u), self._waits(belief.u)
        ahead = self.inner.predict_between(model, belief, row.t, row.u)
        here = either(waits, belief, self._widen(model, belief))
        start = either(waited, _at(here, t=row.t), ahead)
        after, info = self.inner.update(model, start, self._silent(row))
        return either(waits, _after(start, row), after), info

    def _waits(self, u):
        return getattr(u, self.channel) > 0.5

    def _silent(self, row):
        """The row; while paused, all its measurements are missing."""
        return row._replace(y=jax.tree.map(lambda value: jnp.where(self._waits(row.u), jnp.nan, value), row.y))

    def _widen(self, model: StateSpace, belief: Any) -> Any:
        extra, gaussian = dict(self.widen), gaussian_of(belief)
        added = jnp.diag(jnp.asarray([extra.get(name, 0.0) ** 2 for name in model.states], gaussian.vector.dtype))
        spread = kit.innermost(self.inner).form.start(gaussian.covariance + added)
        return with_gaussian(belief, with_spread(gaussian, gaussian.vector, spread))


def _at(belief: Any, **where: Any) -> Any:
    """The belief with another time `t`, other inputs `u` or another `count`."""
    gaussian = gaussian_of(belief)
    spread = Spread(gaussian.factor, gaussian.matrix)
    return with_gaussian(belief, with_spread(gaussian, gaussian.vector, spread, **where))


def _after(belief: Any, row: Any) -> Any:
    """The belief after a row without an update."""
    return _at(belief, t=row.t, u=row.u, count=gaussian_of(belief).count + 1)
