"""Measurements with a share of outliers: every combination of outlying channels, weighted by how well it explains the row."""

from __future__ import annotations

import itertools
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check, float_array
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, with_spread
from jaxveh.filters.gaussian.wrapper import AbstractStateless
from jaxveh.filters.wrappers.base import check_independent, variances_of, with_variances
from jaxveh.filters.wrappers.interacting import mixed_covariance
from jaxveh.statespace import Info, Smoothing, kit

MOST_CHANNELS = 6
"""The largest number of channels: 64 cases."""


class Contaminated(AbstractStateless):
    """`inner` for noise of which a `share` has `factor` times the standard deviation, channel by channel (J. Tukey's law, 1960):

        e ~ (1 - share) N(0, sigma^2) + share N(0, factor^2 sigma^2)

    Which of a row's m channels are outliers is one of 2^m cases, and in each case the row is an ordinary update. The
    belief after the row is the Gaussian with the moments of their mixture (G. Ackerson & K. Fu 1970). `Gated` decides
    for one case; this wrapper weights all, and the log-likelihood of a row is a density of the measurement, so that
    share and factor can be chosen by it, or fitted: they are arrays with gradients. NIS is NaN, as a mixture has none.
    There may be at most six channels. The noise must be Gaussian, with one standard deviation per channel. A filter
    that estimates variances goes outside this one, not inside.

    **Raises** `InputError` for a share that is not between 0 and 1, a factor that is not above 1, too many channels, or
    another wrapper as `inner`.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    rows_between: ClassVar[bool] = True
    whitens: ClassVar[bool] = False
    inner: AbstractRuleFilter
    share: jax.Array = eqx.field(converter=float_array, default=0.05)
    factor: jax.Array = eqx.field(converter=float_array, default=10.0)

    def __check_init__(self):
        check_kind("Contaminated", self.inner, AbstractRuleFilter)
        check("Contaminated.share", self.share, lambda p: (p > 0) & (p < 1), "between 0 and 1")
        check("Contaminated.factor", self.factor, lambda f: f > 1, "above 1")

    def check(self, model):
        check_independent("Contaminated", model)
        count = len(model.channels)
        if count > MOST_CHANNELS:
            raise InputError(
                f"Contaminated: {count} channels ({', '.join(model.channels)}) make {2**count} cases: must be at most "
                f"{MOST_CHANNELS}. Use RobustStudentT or Gated."
            )
        self.inner.check(model)

    def update(self, model, belief, row):
        wild = jnp.asarray(list(itertools.product((False, True), repeat=len(model.channels))))
        own = variances_of(model)
        share, factor = self.share.astype(own.dtype), self.factor.astype(own.dtype)
        variances = jnp.where(wild, jnp.square(factor), 1) * own
        before = jnp.sum(jnp.where(wild, jnp.log(share), jnp.log1p(-share)), axis=-1)
        case = lambda values: _by_case(*self.inner.update(with_variances(model, values), belief, row))
        vectors, covariances, every_info = jax.vmap(case)(variances)
        logs = before + every_info.log_likelihood
        weights = jax.nn.softmax(logs)
        mean, covariance = mixed_covariance(weights, vectors, covariances)
        after = with_spread(belief, mean, self.inner.form.start(covariance), t=row.t, u=row.u, count=belief.count + 1)
        return after, _info(every_info, jnp.exp(before), jax.nn.logsumexp(logs))


def _by_case(after: GaussianBelief, info: Info) -> tuple[Any, Any, Info]:
    return after.vector, after.covariance, info


def _info(every_info: Info, probabilities: Any, log_likelihood: Any) -> Info:
    """One info from those of all cases, which have the same innovation; `probabilities` (r,): those of the cases before
    the row."""
    spread = lambda std: jnp.sqrt(jnp.sum(probabilities * jnp.square(std)))
    nothing = jnp.full_like(log_likelihood, jnp.nan)
    return Info(
        log_likelihood=log_likelihood,
        innovation=jax.tree.map(lambda each: each[0], every_info.innovation),
        innovation_std=jax.tree.map(spread, every_info.innovation_std),
        nis=nothing,
        ess=nothing,
        result=kit.result_of_parts(every_info.result, log_likelihood),
    )
