"""An iterated update, linearised anew at the last result."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import check_whole
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, correct, with_spread
from jaxveh.filters.gaussian.forms import Spread
from jaxveh.filters.gaussian.rules import Image, product, times
from jaxveh.filters.gaussian.wrapper import AbstractStateless
from jaxveh.statespace import Smoothing


class Iterated(AbstractStateless):
    """`inner`, whose update is repeated with the observation linearised under the last posterior.

    With `Extended` it is the iterated extended Kalman filter, Gauss-Newton for the most probable state (B. Bell & F. Cathey
    1993). With points it is iterated posterior linearisation (A. Garcia-Fernandez, L. Svensson, M. Morelande & S. Sarkka 2015):
    the observation becomes `A x + b` with an error of covariance Lambda that the points give. Innovation, NIS and
    log-likelihood are those of the prediction. With a linear observation the iterations change nothing.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    rows_between: ClassVar[bool] = True
    inner: AbstractRuleFilter
    iterations: int = eqx.field(static=True, default=4)

    def __check_init__(self):
        check_kind("Iterated", self.inner, AbstractRuleFilter)
        check_whole("iterations", self.iterations)

    @property
    def linearisations(self):
        return self.iterations

    def update(self, model, belief, row):
        posterior, info = correct(self.inner.form, model, belief, row, self.observe(model, belief, row))

        def again(gaussian, _):
            vector, spread = gaussian
            seen = self.observe(model, with_spread(belief, vector, spread), row)
            line = linearise_image(seen, vector, spread.factor, belief)
            found, _ = correct(self.inner.form, model, belief, row, line)
            return (found.vector, Spread(found.factor, found.matrix)), None

        start = posterior.vector, Spread(posterior.factor, posterior.matrix)
        (vector, spread), _ = jax.lax.scan(again, start, length=self.iterations)
        return with_spread(posterior, vector, spread), info


def linearise_image(image: Image, vector: Any, factor: Any, belief: Any) -> Image:
    """The image under `belief` of the linear function with error that follows from `image`, the image of the Gaussian with
    mean `vector` and this `factor`."""
    slope, rest = line_through(image, factor)
    X = image.spread
    mean = image.mean + times(slope, belief.vector - vector)
    deviations = jnp.concatenate([times(slope, belief.factor), rest], axis=1)
    spread = jnp.concatenate([belief.factor, jnp.zeros_like(X)], axis=1)
    signs = None if image.signs is None else np.concatenate([np.ones(X.shape[0]), image.signs])
    return Image(mean, deviations, spread, signs)


def line_through(image: Image, factor: Any) -> tuple[Any, Any]:
    """The slope A (m, n) and the error's deviations of the linear fit to an image under a Gaussian with this factor.

    A = E W X^T P^-1,    Lambda = (E - A X) W (E - A X)^T
    """
    E, X = image.deviations, image.spread
    slope = numerics.solve_psd(numerics.lower_factor(factor), product(X, E, image.signs)).T
    return slope, E - times(slope, X)
