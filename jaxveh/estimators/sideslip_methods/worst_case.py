"""The single track in a filter that bounds the worst case (section 1.4.4)."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters
from jaxveh._core.errors import check, float_array
from jaxveh.estimators.sideslip_methods.common import Guarded, slowest_of
from jaxveh.estimators.sideslip_methods.single_track import in_filter, lateral_model, single_track
from jaxveh.filters import HInfinity
from jaxveh.io import CarSpecification

SHARE = 0.5
"""Share of the largest possible bound: halfway between the least mean square and the limit that no filter reaches."""

BOUND = 1e4
"""Bound for errors of v_y in m/s: larger than `SHARE` allows wherever the standard deviation of v_y is above 0.01 m/s."""


class HInfinityShare(HInfinity):
    """`filters.HInfinity` whose bound is, in each row, at most `share` of the largest possible one.

    `P^-1 - bound S` stays positive definite as long as the bound is less than one over the trace of P S. So the filter does not
    fail at an uncertain start or with a sliding tyre.
    """

    share: jax.Array = eqx.field(
        converter=lambda v: float_array(np.asarray(v, float) if isinstance(v, float) else v), default=SHARE
    )

    def __check_init__(self):
        check("HInfinityShare.share", self.share, lambda s: (s > 0) & (s < 1), "between 0 and 1")

    def update(self, model, belief, row):
        weights, dtype = self._weights(model, belief), belief.vector.dtype
        trace = jnp.sum(weights * jnp.sum(jnp.square(belief.factor), axis=1))
        bound = jnp.minimum(self.bound.astype(dtype), self.share.astype(dtype) / trace)
        return HInfinity(self.inner, bound, self.scales).update(model, belief, row)


def h_infinity(car: CarSpecification) -> Guarded:
    """Makes the worst-case filter from a car's file: the review's [66], and [67] on nonlinear tyres. Its matrix P is no
    covariance, so that it gives no standard deviation."""
    model = lateral_model(single_track(car), slowest_of(car))
    filter = HInfinityShare(filters.Extended(), BOUND, {"v_y": 1.0})
    return in_filter(car, model, filter)
