"""What all filters around Gaussian filters have in common."""

import equinox as eqx

from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, check_kind
from jaxveh.statespace import AbstractWrapper


class AbstractGaussianWrapper(AbstractGaussianFilter, AbstractWrapper):
    """A Gaussian filter around another, `inner`: a subclass writes what it does otherwise than that."""

    # No postponed annotations in this file: they would make a field of it.
    inner: eqx.AbstractVar[AbstractGaussianFilter]

    def __check_init__(self):
        check_kind(type(self).__name__, self.inner, AbstractGaussianFilter)

    def check(self, model):
        self.inner.check(model)
