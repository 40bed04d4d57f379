"""Measurements that arrive late, and rows that arrive out of order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_positive, check_whole
from jaxveh._core.names import as_pairs, check_names
from jaxveh._core.result import Result, code, with_reason
from jaxveh.filters.outer_belief import AbstractTransparentBelief, either
from jaxveh.statespace import AbstractFilter, AbstractWrapper, Gradient, Info, Row, StateSpace, kit


class DelayedBelief(AbstractTransparentBelief):
    """The newest belief `inside`; the last `rows` in the order of their times, with (depth,) leaves; which of them are
    `real` (depth,); the belief `base` before the first of them; `base_said` and `said`: the log-likelihood of all rows
    up to `base` and up to now; `began`: the time of the first row."""

    inside: Any
    base: Any
    rows: Row
    real: jax.Array
    base_said: jax.Array
    said: jax.Array
    began: Any


class Delayed(AbstractWrapper):
    """Any filter `inner`, with measurements taken in the order of their own times, not of their arrival (Y. Bar-Shalom, X. Li &
    T. Kirubarajan 2001, out-of-sequence measurements; the filter goes back and filters the rows again, which is exact).

    `delays`: by channel, how long before the row's time its value was measured (s), such as `{"gnss_speed": 0.12}`. `step` also
    takes rows that are older than the newest one. The last `depth` rows and late measurements are stored. A measurement older
    than these is left out, with the result code `measurement_too_late`; a delayed value from before the first row is ignored.

    A row in order costs two steps of the filter, a late row `depth` steps. Its info has the change of the total
    log-likelihood, and the innovations of the row's own values. A delayed value takes the inputs of the row before its
    time. Process noise must be continuous in time: an extra row within a step must not add an extra draw.
    """

    inner: AbstractFilter
    delays: tuple[tuple[str, float], ...] = eqx.field(static=True)
    depth: int = eqx.field(static=True)

    has_covariance: ClassVar[bool] = True

    @property
    def gradients(self):
        return Gradient.exact

    def __init__(self, inner: AbstractFilter, delays: Mapping[str, float] | None = None, depth: int = 20):
        self.inner, self.delays, self.depth = inner, tuple(sorted(as_pairs(delays or {}, "Delayed.delays"))), depth

    def __check_init__(self):
        for name, delay in self.delays:
            check_positive(f"Delayed.delays of {name}", delay)
        check_whole("Delayed.depth", self.depth, 1 + len(self.delays), "It must be larger than the number of delays.")

    def check(self, model):
        check_names("Delayed.delays", [name for name, _ in self.delays], model.channels)
        noise = model.process_noise
        if noise is not None and not noise.grows_with_time:
            raise InputError(
                "Delayed: a part of the process noise is drawn once per step (Discrete, or an input's white error), and an extra "
                "row would add it once more. It must be Continuous; give uncertain inputs a correlation time."
            )
        kit.check_rows_between("Delayed", self.inner)
        if model.input_path != "held":
            raise InputError(f"Delayed: the model's inputs run {model.input_path}: input_path must be 'held'.")
        self.inner.check(model)

    def _init(self, model, row, key):
        inside, info = self.inner._init(model, self._prompt(row), key)
        rows = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (self.depth, *jnp.shape(leaf))), row)
        said = info.log_likelihood
        return DelayedBelief(inside, inside, rows, jnp.zeros(self.depth, bool), said, said, row.t), _bare(info)

    def _step(self, model, belief, row):
        before, too_late = belief, jnp.asarray(False)
        in_order = row.t >= before.inside.t
        pieces = [self._late(belief, row, name, delay) for name, delay in self.delays]
        for _, real in pieces:
            in_order = in_order & ~real
        prompt = self._prompt(row)
        for piece, real in [*pieces, (prompt, jnp.asarray(True))]:
            late = real & (piece.t < belief.base.t)
            too_late = too_late | (late & (piece.t >= belief.began))
            belief = self._with_rows(model, belief, piece, real & ~late)
        inside, said, info = jax.lax.cond(in_order, self._onward, self._anew, model, before, belief, prompt)
        result = with_reason(info.result, too_late, Result.measurement_too_late)
        info = info._replace(log_likelihood=said - before.said, result=result)
        after = DelayedBelief(inside, belief.base, belief.rows, belief.real, belief.base_said, said, belief.began)
        return after, info

    def _onward(self, model, before, belief, row) -> tuple[Any, Any, Info]:
        """One step from the newest belief."""
        inside, info = self.inner._step(model, before.inside, row)
        return inside, before.said + info.log_likelihood, _bare(info)

    def _anew(self, model, before, belief, row) -> tuple[Any, Any, Info]:
        """Filter all stored rows again, from the base."""

        def forward(carry, given):
            inside, said = carry
            row, real = given
            after, info = self.inner._step(model, inside, row)
            inside, more = either(real, (after, info.log_likelihood), (inside, jnp.zeros_like(said)))
            new = real & ((row.t == newest) | _among(row.t, times))
            return (inside, said + more), (_bare(info), real, new)

        newest = row.t
        times = [row.t - delay for _, delay in self.delays]
        start = belief.base, belief.base_said
        (inside, said), (every_info, real, new) = jax.lax.scan(forward, start, (belief.rows, belief.real))
        return inside, said, _merge_info(every_info, real, new)

    def _prompt(self, row: Row) -> Row:
        """The row without its delayed values."""
        late = {name for name, _ in self.delays}
        kept = {n: jnp.full_like(v, jnp.nan) if n in late else v for n, v in row.y._asdict().items()}
        return row._replace(y=type(row.y)(**kept))

    def _late(self, belief: DelayedBelief, row: Row, name: str, delay: float) -> tuple[Row, Any]:
        """The delayed value of a channel as a row at its own time, and whether there is one."""
        kept = {n: v if n == name else jnp.full_like(v, jnp.nan) for n, v in row.y._asdict().items()}
        t = row.t - delay
        earlier = belief.real & (belief.rows.t <= t)
        place = jnp.argmax(jnp.where(earlier, belief.rows.t, -jnp.inf))
        u = jax.tree.map(
            lambda rows, base: jnp.where(jnp.any(earlier), rows[place], base), belief.rows.u, belief.base.u
        )
        return Row(t, u, type(row.y)(**kept)), ~jnp.isnan(getattr(row.y, name))

    def _with_rows(self, model: StateSpace, belief: DelayedBelief, piece: Row, real) -> DelayedBelief:
        """The belief with `piece` inserted among its rows; the oldest row goes into the base."""
        # A row that is not real is filtered, too, and thrown away. Its time is that of the base: a step back in time
        # would have no derivative.
        piece = piece._replace(t=jnp.where(real, piece.t, belief.base.t))
        longer = lambda rows, one: jnp.concatenate([rows, one[None]])
        rows, reals = jax.tree.map(longer, (belief.rows, belief.real), (piece, real))
        order = jnp.argsort(jnp.where(reals, rows.t, -jnp.inf), stable=True)
        rows, reals = jax.tree.map(lambda leaf: leaf[order], (rows, reals))
        oldest = jax.tree.map(lambda leaf: leaf[0], rows)

        def absorb(base, said):
            after, info = self.inner._step(model, base, oldest)
            return after, said + info.log_likelihood

        base, said = jax.lax.cond(reals[0], absorb, lambda base, said: (base, said), belief.base, belief.base_said)
        rows, reals = jax.tree.map(lambda leaf: leaf[1:], (rows, reals))
        return DelayedBelief(belief.inside, base, rows, reals, said, belief.said, belief.began)


def _bare(info: Info) -> Info:
    """The info without the fields that have no meaning for several rows at once."""
    return info._replace(whitened=None, log_scale=None)


def _among(t: Any, times: list) -> Any:
    found = jnp.asarray(False)
    for other in times:
        found = found | (t == other)
    return found


def _merge_info(every_info: Info, real: Any, new: Any) -> Info:
    """The info of all rows filtered anew: innovations and NIS of the new ones, the first failure and the first remark of all."""
    pick = lambda values: jnp.sum(jnp.where(new & jnp.isfinite(values), values, 0), axis=0)
    seen = lambda values: jnp.any(new & jnp.isfinite(values), axis=0)
    by_channel = lambda tree: jax.tree.map(lambda v: jnp.where(seen(v), pick(v), jnp.nan), tree)
    return Info(
        log_likelihood=jnp.sum(every_info.log_likelihood),
        innovation=by_channel(every_info.innovation),
        innovation_std=by_channel(every_info.innovation_std),
        nis=jnp.where(jnp.any(jnp.isfinite(every_info.nis)), pick(every_info.nis), jnp.nan),
        ess=every_info.ess[-1],
        result=_first(every_info.result, real),
        remark=None if every_info.remark is None else _first(every_info.remark, real),
    )


def _first(codes: Any, real: Any) -> Any:
    """The first non-zero code of the real rows' codes (T,); zero if there is none."""
    told = real & (codes != 0)
    return jnp.where(jnp.any(told), codes[jnp.argmax(told)], code(Result.successful))
