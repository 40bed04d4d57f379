"""Measurements far from their prediction are left out, channel by channel."""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import check_positive
from jaxveh._core.names import record
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.gaussian.wrapper import AbstractStateless
from jaxveh.filters.wrappers.innovation import innovation
from jaxveh.statespace import Smoothing


class Gated(AbstractStateless):
    """`inner`, for which a channel counts as missing if its innovation exceeds `limit` standard deviations of the innovation.

    If one sensor fails, the others are still used (Y. Bar-Shalom, X. Li & T. Kirubarajan, Estimation with Applications
    to Tracking and Navigation, sec. 5.4: validation). A filter with a wrong estimate rejects the measurements that could correct
    it: keep the limit wide, 3 to 5, and check how often each channel is left out; `info.innovation` is NaN there.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    rows_between: ClassVar[bool] = True
    inner: AbstractGaussianFilter
    limit: float = eqx.field(static=True, default=4.0)

    def __check_init__(self):
        check_positive("Gated.limit", self.limit)

    def update(self, model, belief, row):
        found = innovation(self.inner, model, belief, row)
        wild = jnp.square(found.error) > self.limit**2 * (found.expected + found.noise)
        kept = [jnp.where(wild[i], jnp.nan, getattr(row.y, name)) for i, name in enumerate(model.channels)]
        y = record("Measurements", dict(zip(model.channels, kept, strict=True)))
        return self.inner.update(model, belief, row._replace(y=y))
