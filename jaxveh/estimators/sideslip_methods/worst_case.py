"""The single track in a filter that looks at the worst case (section 1.4.4)."""

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
"""Of the largest bound that there is: halfway between the mean square and what no filter reaches."""

BOUND = 1e4
"""Of errors of v_y in m/s: more than `SHARE` allows wherever v_y is less well known than to 0.01 m/s."""


class HInfinityShare(HInfinity):
    """`filters.HInfinity` whose bound is, in each row, no more than `share` of what is possible there.

    `P^-1 - bound S` stays positive definite as long as the bound is less than one over the trace of P S, so that a start that is
    not well known, or a tyre that slides, does not end the filter.
    """

    share: jax.Array = eqx.field(
        converter=lambda v: float_array(np.asarray(v, float) if isinstance(v, float) else v), default=SHARE
    )

    def __check_init__(self):
        check("HInfinityShare.share", self.share, lambda s: (s > 0) & (s < 1), "between 0 and 1")

    def update(self, model, belief, row):
        scales, dtype = dict(self.scales), belief.vector.dtype
        weights = jnp.asarray([1.0 / scales[n] ** 2 if n in scales else 0.0 for n in model.states], dtype)
        trace = jnp.sum(weights * jnp.sum(jnp.square(belief.factor), axis=1))
        bound = jnp.minimum(self.bound.astype(dtype), self.share.astype(dtype) / trace)
        return HInfinity(self.inner, bound, self.scales).update(model, belief, row)


def h_infinity(car: CarSpecification) -> Guarded:
    """The worst-case filter for a car's file: the review's [66], and [67] on nonlinear tyres. What it states is no spread."""
    model = lateral_model(single_track(car), slowest_of(car))
    filter = HInfinityShare(filters.Extended(), BOUND, {"v_y": 1.0})
    return in_filter(car, model, filter)
