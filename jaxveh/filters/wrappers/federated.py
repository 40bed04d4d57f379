"""Local filters, each with its own sensors, and a master filter that fuses them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.names import as_groups, as_several, check_names, record
from jaxveh._core.result import Result, with_reason
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, with_spread
from jaxveh.filters.gaussian.forms import Spread
from jaxveh.filters.gaussian.rules import times
from jaxveh.filters.outer_belief import AbstractTransparentBelief, either
from jaxveh.statespace import AbstractProcessNoise, AbstractWrapper, Gradient, Row, StateSpace


class FederatedBelief(AbstractTransparentBelief):
    """The Gaussian of the master, `inside`; those of the local filters, `locals`; their `shares` (k,) of the
    information; and `alarm` (k,), the fading mean of the NIS of their sensors over its expected value."""

    inside: GaussianBelief
    locals: tuple[GaussianBelief, ...]
    shares: jax.Array
    alarm: jax.Array


def _as_shares(values) -> Any:
    return None if values is None else as_several(values, "Federated.shares")


class Federated(AbstractWrapper):
    """N. Carlson's federated filter (IEEE Trans. Aerospace and Electronic Systems 26, 1990) with local filters of the
    same `inner`.

    Every local filter has all states, the sensors of its own entry of `groups` (tuples of channels), and the
    covariances of the prior and of the process noise divided by its share, so that no information is used twice:

        P^-1 = sum P_i^-1,    x = P sum P_i^-1 x_i;    reset:  x_i = x, P_i = P / share_i

    With `reset` (fusion-reset) this is the centralised filter on linear models. Without it, the local filters continue
    from their own estimates, which is more robust and less accurate.

    With `common` there are no shares: each local filter has the whole prediction, and this common information counts
    once in the fusion (H. Hashemipour, S. Roy & A. Laub, IEEE Trans. Automatic Control 33, 1988):

        P^-1 = P_-^-1 + sum (P_i^-1 - P_-^-1),    x = P (P_-^-1 x_- + sum (P_i^-1 x_i - P_-^-1 x_-))

    On linear models the result is the same. On nonlinear models it is nearer to the centralised filter: with shares,
    sigma points lie sqrt(1 / share) times too far out.

    `shares`: fixed, by default equal; `by_trace`: shares in proportion to 1 / trace(P_i), with variances divided by
    those of the prior. `isolate`: the measurements of a local filter are left out of the fusion while the fading mean
    of their NIS exceeds this multiple of its expected value (None: never); the mean is still updated.

    Groups that share a channel count its information twice and raise `InputError`, unless `overlapping`. The info is
    that of the fused prediction with all sensors.
    """

    whitens: ClassVar[bool] = True
    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    inner: AbstractRuleFilter
    groups: tuple[tuple[str, ...], ...] = eqx.field(static=True, converter=as_groups)
    shares: tuple[float, ...] | None = eqx.field(static=True, default=None, converter=_as_shares)
    by_trace: bool = eqx.field(static=True, default=False)
    reset: bool = eqx.field(static=True, default=True)
    common: bool = eqx.field(static=True, default=False)
    isolate: float | None = eqx.field(static=True, default=None)
    forgetting: float = eqx.field(static=True, default=0.9)
    overlapping: bool = eqx.field(static=True, default=False)

    @property
    def gradients(self):
        return Gradient.exact

    def __check_init__(self):
        check_kind("Federated", self.inner, AbstractRuleFilter)
        if self.groups is None or len(self.groups) < 2:
            raise InputError(
                f"Federated.groups has {len(self.groups or ())} member(s): must be at least two tuples of channels."
            )
        names = [name for group in self.groups for name in group]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice and not self.overlapping:
            raise InputError(
                f"Federated.groups: {', '.join(twice)} in more than one group: its information would count twice. "
                "overlapping=True allows it."
            )
        if self.shares is not None:
            if len(self.shares) != len(self.groups):
                raise InputError(
                    f"Federated.shares has {len(self.shares)} member(s): must be {len(self.groups)}, one for each group."
                )
            check("Federated.shares", self.shares, lambda _: True, "positive, with the sum 1")
            fine = abs(sum(self.shares) - 1) < 1e-9 and min(self.shares) > 0
            check("Federated.shares", self.shares, lambda _: fine, "positive, with the sum 1")
        if self.common and (not self.reset or self.shares is not None or self.by_trace):
            raise InputError("Federated.common: shares and by_trace must not be given with it, and reset must be True.")
        if self.isolate is not None:
            check("Federated.isolate", self.isolate, lambda v: v > 1, "above 1")
        check("Federated.forgetting", self.forgetting, lambda v: (v >= 0) & (v < 1), "at least 0 and below 1")

    def check(self, model):
        self.inner.check(model)
        names = [name for group in self.groups for name in group]
        check_names("Federated.groups", names, model.channels)
        left = [name for name in model.channels if name not in names]
        if left:
            raise InputError(f"Federated.groups: no group has {', '.join(left)}.")

    def _init(self, model, row, key):
        prior = self.inner.prior(model, row)
        k = len(self.groups)
        shares = self.shares or (1 / k,) * k
        shares = jnp.asarray(shares, prior.vector.dtype)
        # The first row makes the local beliefs of what is handed out.
        start = FederatedBelief(prior, (), shares, jnp.ones_like(shares))
        return self._update_locals(model, start, prior, self._hand_out(prior, shares), row)

    def _step(self, model, belief, row):
        if self.common:
            predicted = self.inner.predict_between(model, belief.inside, row.t, row.u)
            return self._update_locals(model, belief, predicted, self._hand_out(predicted, belief.shares), row)
        # One program for all local filters: they differ only in numbers.
        before = self._hand_out(belief.inside, belief.shares) if self.reset else _together(belief.locals)

        def ahead(local, share):
            return self.inner.predict_between(_with_process_noise_over(model, share), local, row.t, row.u)

        alone = jax.vmap(ahead)(before, belief.shares)
        return self._update_locals(model, belief, self._fuse(alone, belief.inside), alone, row)

    def _hand_out(self, master: GaussianBelief, shares) -> GaussianBelief:
        """The beliefs of the local filters, stacked along the first axis of each array."""
        return jax.vmap(lambda share: master.inflate(1.0 if self.common else 1.0 / share))(shares)

    def _update_locals(self, model, belief: FederatedBelief, predicted: GaussianBelief, ahead: GaussianBelief, row):
        rows = _together([_only(row, group).y for group in self.groups])
        own = lambda local, y: self.inner.update(model, local, row._replace(y=y))
        found, _ = jax.vmap(own)(ahead, rows)
        # The prediction of a local filter is wide, so that its NIS is seldom large: sensors are judged by the fused prediction.
        every = jax.tree.map(lambda one, some: jnp.concatenate([one[None], some]), row.y, rows)
        every_info = jax.vmap(lambda y: own(predicted, y)[1])(every)
        info, surprise = jax.tree.map(lambda leaf: leaf[0], every_info), every_info.nis[1:]
        counts = jnp.stack([_count(row, group) for group in self.groups])
        ratio = surprise / jnp.maximum(counts, 1.0)
        alarm = jnp.where(counts > 0, self.forgetting * belief.alarm + (1.0 - self.forgetting) * ratio, belief.alarm)
        trusted = jnp.ones(len(self.groups), bool) if self.isolate is None else alarm < self.isolate
        # If all local filters are suspect, none can be judged by the others, and all are used.
        trusted = trusted | ~jnp.any(trusted)
        believed = jax.vmap(either)(trusted, found, jax.vmap(lambda local: _after(local, row))(ahead))
        master = self._fuse(believed, belief.inside, predicted if self.common else None)
        master = with_spread(
            master, master.vector, Spread(master.factor, master.matrix), row.t, row.u, belief.count + 1
        )
        lost = ~(jnp.all(jnp.isfinite(master.factor)) & jnp.all(jnp.isfinite(master.vector)))
        result = with_reason(info.result, lost, Result.not_positive_definite)
        locals_ = tuple(jax.tree.map(lambda leaf, i=i: leaf[i], believed) for i in range(len(self.groups)))
        found = FederatedBelief(master, locals_, self._new_shares(model, belief, locals_), alarm)
        return found, info._replace(result=result)

    def _new_shares(self, model, belief, locals_):
        if not self.by_trace:
            return belief.shares
        scale = jnp.diagonal(model.prior.covariance())
        traces = jnp.stack([jnp.sum(local.variances / scale) for local in locals_])
        return (1.0 / traces) / jnp.sum(1.0 / traces)

    def _fuse(
        self, beliefs: GaussianBelief, like: GaussianBelief, common: GaussianBelief | None = None
    ) -> GaussianBelief:
        """The Gaussian of all beliefs' information, with the time and inputs of `like`; the information `common` to all
        counts once."""
        informations, pulls = jax.vmap(self._information)(beliefs)
        information, pull = jnp.sum(informations, axis=0), jnp.sum(pulls, axis=0)
        if common is not None:
            once, pulled = self._information(common)
            again = len(self.groups) - 1
            information, pull = information - again * once, pull - again * pulled
        factor = numerics.cholesky(information)
        mean = numerics.solve_psd(factor, pull)
        return with_spread(like, mean, self.inner.form.start(numerics.inverse_psd(factor)), t=beliefs.t[0])

    def _information(self, belief: GaussianBelief) -> tuple[Any, Any]:
        """The information P^-1 (n, n) and P^-1 x (n,)."""
        triangular = self.inner.form.triangular
        information = numerics.inverse_psd(belief.factor if triangular else numerics.lower_factor(belief.factor))
        return information, times(information, belief.vector)


def _together(trees: Sequence[Any]) -> Any:
    """Trees of one structure as one tree, with arrays stacked along a new first axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def _only(row: Row, group: tuple[str, ...]) -> Row:
    """The row with the channels of a group; the others are missing."""
    y = row.y._asdict()
    return row._replace(
        y=record("Measurements", {n: v if n in group else jnp.full_like(v, jnp.nan) for n, v in y.items()})
    )


def _after(local: GaussianBelief, row: Row) -> GaussianBelief:
    """A local's prediction as its belief after the row, from whose inputs the next step goes on."""
    return with_spread(local, local.vector, Spread(local.factor, local.matrix), row.t, row.u, local.count + 1)


def _count(row: Row, group: tuple[str, ...]) -> Any:
    here = [jnp.isfinite(getattr(row.y, name)) for name in group]
    return jnp.sum(jnp.stack(here).astype(row.t.dtype))


class _Shared(AbstractProcessNoise):
    """A process noise whose covariance is divided by a local's share."""

    whole: AbstractProcessNoise
    share: Any

    @property
    def law(self):
        return self.whole.law

    def over(self, dt):
        return self.whole.over(dt).times(1.0 / jnp.sqrt(self.share))


def _with_process_noise_over(model: StateSpace, share) -> StateSpace:
    if model.process_noise is None:
        return model
    return eqx.tree_at(lambda m: m.process_noise, model, _Shared(model.process_noise, share))
