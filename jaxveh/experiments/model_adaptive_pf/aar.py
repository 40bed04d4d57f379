"""The paper's adaptive autoregression: a particle filter with a transition that is learned from its own estimates."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_whole
from jaxveh.experiments.model_adaptive_pf.models import BodyState
from jaxveh.filters import kit
from jaxveh.statespace import AbstractFilter, AbstractWrapper, StateSpace


class Learned(NamedTuple):
    """The learned numbers of each state, by name: `keeps` (-), its coefficient a; `spread`, the A of eqs 22 to 24 (its unit
    squared), or the P of least squares (one over that)."""

    keeps: BodyState
    spread: BodyState


class AutoRegressive(AbstractWrapper):
    """`inner` of an `autoregression` model whose coefficients follow the filter's own means (eqs 20 to 25, order p = 1).

    With X the mean of the row before, e = X_t - a X and U = `update`, state by state:

    - as least squares with forgetting: `k = P X / (1 - U + X P X)`, `a += k e`, `P = (1 - k X) P / (1 - U)`;
    - `as_printed`: `A = (1 - U) A + U X^2`, `k = U A X / (U X A X + 1)`, `a += k e`. Erratum: A stands where least
      squares has its inverse, so that large numbers (v_x) learn in one row and small ones (v_y, yaw rate) never.

    Both start at a = 1, and with P at `1 / first^2`, as if the state had been about `first` once (m/s, m/s, rad/s).
    """

    inner: AbstractFilter
    update: float = eqx.field(static=True, default=0.02)
    as_printed: bool = eqx.field(static=True, default=False)
    first: tuple[float, float, float] = eqx.field(static=True, default=(10.0, 0.1, 0.1))

    def check(self, model):
        self.inner.check(model)

    def _init(self, model, row, key):
        inside, info = self.inner._init(model, row, key)
        squares = BodyState(
            *(jnp.full_like(value, size**2) for value, size in zip(inside.mean, self.first, strict=True))
        )
        spread = squares if self.as_printed else jax.tree.map(lambda square: 1.0 / square, squares)
        return kit.Remembering(inside, Learned(model.system.keeps, spread)), info

    def _step(self, model, belief, row):
        before = belief.inside.mean
        inside, info = self.inner._step(_with_memory(model, belief.memory), belief.inside, row)
        pairs = [self._learn(*values) for values in zip(*belief.memory, before, inside.mean, strict=True)]
        memory = Learned(*(BodyState(*values) for values in zip(*pairs, strict=True)))
        return kit.Remembering(inside, memory), info

    def _learn(self, a, spread, X, now):
        """The coefficient and its `spread` after a row."""
        U, e = self.update, now - a * X
        if self.as_printed:
            A = (1.0 - U) * spread + U * X**2
            return a + U * A * X / (U * X * A * X + 1.0) * e, A
        k = spread * X / (1.0 - U + X * spread * X)
        return a + k * e, (1.0 - k * X) * spread / (1.0 - U)


def _with_memory(model: StateSpace, memory: Learned) -> Any:
    return eqx.tree_at(lambda m: m.system.keeps, model, memory.keeps)


class Fitted(NamedTuple):
    """`coefficients` [A_1, ..., A_p] (3, 3 p) and the `spread` P (3 p, 3 p) of least squares, and `past`: the last p means,
    the newest first (3 p,); all in units of `first`."""

    coefficients: Any
    spread: Any
    past: Any


class MatrixAutoRegressive(AbstractWrapper):
    """`inner` of a `matrix_autoregression` model: eqs 20 to 25 of order `order`, each state from all states of the last p
    rows.

    With phi the means of these rows, e = X_t - A phi and U = `update`, least squares with forgetting, corrected as in
    `AutoRegressive`: `k = P phi / (1 - U + phi' P phi)`, `A += e k'`, `P = (P - k phi' P) / (1 - U)`. It starts at A_1 = I
    with the other matrices zero, and P = I in units of `first` (m/s, m/s, rad/s). Rows before the last are the filter's
    means, not each particle's own past.
    """

    inner: AbstractFilter
    order: int = eqx.field(static=True, default=1)
    update: float = eqx.field(static=True, default=0.02)
    first: tuple[float, float, float] = eqx.field(static=True, default=(10.0, 0.1, 0.1))

    def __check_init__(self):
        check_whole("MatrixAutoRegressive.order", self.order)

    def check(self, model):
        self.inner.check(model)

    def _init(self, model, row, key):
        inside, info = self.inner._init(model, row, key)
        now, n = self._scaled(inside.mean), 3 * self.order
        return kit.Remembering(inside, Fitted(jnp.eye(3, n), jnp.eye(n), jnp.tile(now, self.order))), info

    def _step(self, model, belief, row):
        memory, sizes = belief.memory, jnp.asarray(self.first)
        own = memory.coefficients[:, :3] * sizes[:, None] / sizes
        added = sizes * (memory.coefficients[:, 3:] @ memory.past[3:])
        where = lambda m: (m.system.own, m.system.offset)
        inside, info = self.inner._step(eqx.tree_at(where, model, (own, BodyState(*added))), belief.inside, row)
        return kit.Remembering(inside, self.learn(memory, self._scaled(inside.mean))), info

    def learn(self, memory: Fitted, now: Any) -> Fitted:
        """The coefficients, their spread and the past after the mean `now` (3,)."""
        U, phi = self.update, memory.past
        k = memory.spread @ phi / (1.0 - U + phi @ memory.spread @ phi)
        A = memory.coefficients + jnp.outer(now - memory.coefficients @ phi, k)
        P = (memory.spread - jnp.outer(k, phi @ memory.spread)) / (1.0 - U)
        return Fitted(A, 0.5 * (P + P.T), jnp.concatenate([now, phi[:-3]]))

    def _scaled(self, mean: Any):
        """The body's mean in units of `first`, (3,)."""
        return jnp.stack(list(mean)[:3]) / jnp.asarray(self.first)
