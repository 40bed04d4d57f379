"""The common base of wrappers of Gaussian filters."""

from typing import ClassVar

import equinox as eqx

from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, check_kind
from jaxveh.statespace import AbstractWrapper


class AbstractGaussianWrapper(AbstractGaussianFilter, AbstractWrapper):
    """A Gaussian filter around another, `inner`: a subclass defines only its differences from `inner`."""

    # No postponed annotations in this file: they would turn this and class variables into fields.
    inner: eqx.AbstractVar[AbstractGaussianFilter]
    written_out: ClassVar[bool] = True

    def __check_init__(self):
        check_kind(type(self).__name__, self.inner, AbstractGaussianFilter)

    def check(self, model):
        self.inner.check(model)


class AbstractStateless(AbstractGaussianWrapper):
    """A filter around another, `inner`, without a state of its own: its belief is that of `inner`."""

    noise_by_row: ClassVar[bool] = True

    def prior(self, model, row):
        return self.inner.prior(model, row)

    def predict_between(self, model, belief, t, u_next):
        return self.inner.predict_between(model, belief, t, u_next)

    def observe(self, model, belief, row):
        return self.inner.observe(model, belief, row)

    def adapted_model(self, model, belief):
        return self.inner.adapted_model(model, belief)
