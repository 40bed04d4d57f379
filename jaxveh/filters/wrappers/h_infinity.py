"""The H-infinity filter: it bounds the worst case instead of the mean square error."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import check, float_array
from jaxveh._core.names import as_pairs, check_names
from jaxveh._core.result import Result, code
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, with_spread
from jaxveh.filters.gaussian.wrapper import AbstractStateless


class HInfinity(AbstractStateless):
    """`inner` with a bound of 1 / `bound` on the worst ratio of the estimate's error to all disturbances (D. Simon,
    Optimal State Estimation, 2006, eq 11.89).

        P~ = (P^-1 - bound S)^-1,    then the Kalman update with P~

    S has on its diagonal 1 / scale^2 of each state in `scales`: the states whose error is to be small, each with the scale of
    its error. Noise covariances are here weights of disturbances, not distributions. A larger bound trusts measurements more; if
    it is too large, P~ is not positive definite, and the result code shows it (Simon's condition includes the row's own
    information and is a little weaker). With bound 0 it is the Kalman filter. Log-likelihoods are those of the wider prediction.
    """

    inner: AbstractRuleFilter
    bound: jax.Array = eqx.field(converter=lambda v: float_array(v if eqx.is_array(v) else np.asarray(v)))
    scales: tuple[tuple[str, float], ...] = eqx.field(static=True, converter=lambda v: as_pairs(v, "HInfinity.scales"))

    def __check_init__(self):
        check_kind("HInfinity", self.inner, AbstractRuleFilter)
        check("HInfinity.bound", self.bound, lambda b: b >= 0, "at least 0")
        for name, scale in self.scales:
            check(f"HInfinity.scales of {name}", scale, lambda s: s > 0, "positive")

    def check(self, model):
        self.inner.check(model)
        check_names("HInfinity.scales", [name for name, _ in self.scales], model.states)

    def _weights(self, model, belief):
        """The diagonal of S."""
        scales = dict(self.scales)
        return jnp.asarray([1.0 / scales[n] ** 2 if n in scales else 0.0 for n in model.states], belief.vector.dtype)

    def update(self, model, belief, row):
        weights, dtype = self._weights(model, belief), belief.vector.dtype
        information = numerics.inverse_psd(numerics.lower_factor(belief.factor))
        information = information - jnp.diag(self.bound.astype(dtype) * weights)
        wider = numerics.inverse_psd(numerics.cholesky(information))
        after, info = self.inner.update(model, with_spread(belief, belief.vector, self.inner.form.start(wider)), row)
        # A finite covariance that the bound made infinite is not a divergence of the model.
        too_large = jnp.all(jnp.isfinite(belief.factor)) & ~jnp.all(jnp.isfinite(wider))
        return after, info._replace(result=jnp.where(too_large, code(Result.not_positive_definite), info.result))
