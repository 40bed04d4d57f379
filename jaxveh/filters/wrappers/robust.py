"""Measurements with outliers: the noise is taken to be larger where a residual is larger."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check_positive, check_whole
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, measurements_of, wrapped_innovation
from jaxveh.filters.gaussian.rules import spread_of
from jaxveh.filters.gaussian.wrapper import AbstractStateless
from jaxveh.filters.wrappers.base import (
    check_independent,
    variances_of,
    with_variances,
)
from jaxveh.filters.wrappers.innovation import innovation
from jaxveh.statespace import Smoothing, kit


class AbstractReweighting(AbstractStateless):
    """A filter around another that takes a row's noise to be larger where a residual is larger. The noise must be
    Gaussian, with one standard deviation per channel. A filter inside that estimates the noise would use its own, and is
    refused. A subclass writes `update`."""

    rows_between: ClassVar[bool] = True

    def check(self, model):
        who = type(self).__name__
        check_independent(who, model)
        kit.check_noise_by_row(who, self.inner)
        self.inner.check(model)


class Huber(AbstractReweighting):
    """`inner` with Huber's loss of the innovations, linear beyond `threshold` standard deviations of the innovation.

    Each channel's noise variance is divided by `min(1, threshold / |e|)`, with e the innovation over its predicted standard
    deviation (P. Huber 1964; after C. Karlgaard & H. Schaub 2007, who scale by that of the noise and iterate). The log-likelihood
    is that of the Gaussian with the larger variances, not the density of Huber's law. The noise must be Gaussian, with one
    standard deviation per channel. A filter that estimates variances goes outside this one, not inside.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    inner: AbstractGaussianFilter
    threshold: float = eqx.field(static=True, default=1.345)

    def __check_init__(self):
        check_positive("Huber.threshold", self.threshold)

    def update(self, model, belief, row):
        found = innovation(self.inner, model, belief, row)
        squared = jnp.square(found.error) / (found.expected + found.noise)
        large = squared > self.threshold**2
        weight = jnp.where(large, self.threshold / jnp.sqrt(numerics.or_one(squared, large)), 1)
        return self.inner.update(with_variances(model, variances_of(model) / weight), belief, row)


class RobustStudentT(AbstractReweighting):
    """`inner` for noise of Student's t law with `dof` degrees of freedom and the model's standard deviations as scales.

    A t law is a Gaussian with a random precision. Variational Bayes computes the precision and the state in turns, with
    E[(y - h)^2] the squared residual plus the variance H P H^T of the belief (R. Piche, S. Sarkka & J. Hartikainen 2012):

        variance / scale^2 = (dof + E[(y - h)^2] / scale^2) / (dof + 1)

    Each channel has its own precision. The log-likelihood is that of the Gaussian with the last variances, not the
    density of the t law. The noise must be Gaussian, with one standard deviation per channel.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    inner: AbstractGaussianFilter
    dof: float = eqx.field(static=True, default=4.0)
    iterations: int = eqx.field(static=True, default=3)

    def __check_init__(self):
        check_positive("RobustStudentT.dof", self.dof)
        check_whole("RobustStudentT.iterations", self.iterations)

    def update(self, model, belief, row):
        scale = variances_of(model)

        def again(variances, _):
            after, _ = self.inner.update(with_variances(model, variances), belief, row)
            expected = expected_squares(self.inner, model, after, row)
            return scale * (self.dof + expected / scale) / (self.dof + 1.0), None

        variances, _ = jax.lax.scan(jax.checkpoint(again), scale, length=self.iterations)
        return self.inner.update(with_variances(model, variances), belief, row)


def expected_squares(filter: AbstractGaussianFilter, model: Any, belief: Any, row: Any) -> Any:
    """E[(y - h)^2] (m,) under a belief after the row: the squared residual plus the belief's variance of h."""
    image = filter.observe(model, belief, row)
    given, here = measurements_of(model, row)
    return jnp.square(wrapped_innovation(model, given - image.mean, here)) + spread_of(image)
