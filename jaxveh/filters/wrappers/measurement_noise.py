"""Measurement noise that is estimated along with the state."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check, check_whole
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.wrappers.base import (
    AbstractLearnedNoise,
    Remembering,
    variances_of,
    with_variances,
)
from jaxveh.filters.wrappers.innovation import innovation
from jaxveh.filters.wrappers.robust import expected_squares
from jaxveh.statespace import Smoothing


class SageHusa(AbstractLearnedNoise):
    """`inner` with measurement variances that match those of the innovations (A. Sage & G. Husa 1969, in fading form).

        R <- (1 - d) R + d (e^2 - H P H^T),    d = (1 - b) / (1 - b^(k+1)),    b = `forgetting`

    channel by channel, over the rows in which it is present, and limited to `floor` and `ceiling` times the model's own
    variance, because the difference may be negative. A row is filtered with the variances estimated before it, so that
    likelihood and NIS are predictions. Model errors are taken for sensor noise. The noise must be Gaussian, with one
    standard deviation per channel.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    inner: AbstractGaussianFilter
    forgetting: float = eqx.field(static=True, default=0.98)
    floor: float = eqx.field(static=True, default=0.01)
    ceiling: float = eqx.field(static=True, default=100.0)

    def __check_init__(self):
        check("SageHusa.forgetting", self.forgetting, lambda b: (b > 0) & (b < 1), "between 0 and 1")
        check("SageHusa.floor", self.floor, lambda v: (v > 0) & (v <= 1), "above 0 and at most 1")
        check("SageHusa.ceiling", self.ceiling, lambda v: v >= 1, "at least 1")

    def start(self, model):
        variances = variances_of(model)
        # The model's own variances count as one row.
        return variances, jnp.ones_like(variances)

    def believed_model(self, model, memory):
        return with_variances(model, memory[0])

    def update(self, model, belief, row):
        found = innovation(self.inner, self.believed_model(model, belief.memory), belief.inside, row)
        after, info = self.update_inside(model, belief, row)
        variances, rows = belief.memory
        share = (1.0 - self.forgetting) / (1.0 - self.forgetting ** (rows + 1.0))
        learned = (1.0 - share) * variances + share * (jnp.square(found.error) - found.expected)
        own = variances_of(model)
        learned = jnp.clip(learned, self.floor * own, self.ceiling * own)
        memory = jnp.where(found.here, learned, variances), rows + found.here.astype(rows.dtype)
        return Remembering(after.inside, memory), info


class Precisions(NamedTuple):
    """The inverse-gamma laws of the variances (m,): `shape` (-) and `scale` (the channel's unit squared);
    1 / E[1 / variance] is scale / shape."""

    shape: Any
    scale: Any


class VariationalBayes(AbstractLearnedNoise):
    """`inner` with measurement variances as unknowns with inverse-gamma laws (S. Sarkka & A. Nummenmaa 2009).

    Between rows, shape and scale are multiplied by `forgetting`, so that the laws are based on about 1 / (1 - forgetting) rows.
    In a row, the state given the variances scale / shape and the variances given the state are computed in turns:

        shape <- shape + 1/2,    scale <- scale + E[(y - h)^2] / 2

    `weight`: the number of rows that the model's own variances count for at first. The noise must be Gaussian, with one
    standard deviation per channel.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    inner: AbstractGaussianFilter
    forgetting: float = eqx.field(static=True, default=0.98)
    weight: float = eqx.field(static=True, default=10.0)
    iterations: int = eqx.field(static=True, default=3)

    def __check_init__(self):
        check("VariationalBayes.forgetting", self.forgetting, lambda b: (b > 0) & (b <= 1), "above 0 and at most 1")
        check("VariationalBayes.weight", self.weight, lambda v: v > 0, "positive")
        check_whole("VariationalBayes.iterations", self.iterations)

    def start(self, model):
        variances = variances_of(model)
        shape = jnp.full_like(variances, 0.5 * self.weight)
        return Precisions(shape, shape * variances)

    def believed_model(self, model, memory):
        return with_variances(model, memory.scale / memory.shape)

    def update(self, model, belief, row):
        here = jnp.stack([jnp.isfinite(getattr(row.y, name)) for name in model.channels])
        before = jax.tree.map(lambda value: jnp.where(here, self.forgetting * value, value), belief.memory)
        shape = jnp.where(here, before.shape + 0.5, before.shape)

        def again(scale, _):
            own = self.believed_model(model, Precisions(shape, scale))
            after, _ = self.inner.update(own, belief.inside, row)
            expected = expected_squares(self.inner, model, after, row)
            return jnp.where(here, before.scale + 0.5 * expected, scale), None

        start = before.scale * (shape / before.shape)
        scale, _ = jax.lax.scan(jax.checkpoint(again), start, length=self.iterations)
        _, info = self.update_inside(model, belief, row)
        after, _ = self.update_inside(model, Remembering(belief.inside, Precisions(shape, scale)), row)
        return after, info
