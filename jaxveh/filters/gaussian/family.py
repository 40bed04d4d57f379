"""The Kalman family: one filter per rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx

from jaxveh._core.errors import InputError, word_for
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_covariances
from jaxveh.filters.gaussian.forms import AbstractForm, Covariance
from jaxveh.filters.gaussian.linear import check_linear
from jaxveh.filters.gaussian.rules import Points, Slopes
from jaxveh.numerics import sigma_points
from jaxveh.statespace import Smoothing


class Kalman(AbstractRuleFilter):
    """The exact filter of linear models with Gaussian noises (R. Kalman 1960; Sarkka 2013, sec. 4.3).

    A model that is not linear raises `InputError`: take `Extended`, which linearises.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    shares_covariances: ClassVar[bool] = True
    form: AbstractForm = Covariance()

    def rule(self, n):
        return Slopes()

    @property
    def linearisations(self):
        return 0

    def check(self, model):
        check_covariances(type(self).__name__, model)
        check_linear(type(self).__name__, model)


class Extended(AbstractRuleFilter):
    """The extended Kalman filter of first order, which linearises at the mean (Sarkka 2013, sec. 5.2)."""

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    form: AbstractForm = Covariance()

    def rule(self, n):
        return Slopes()


class Unscented(AbstractRuleFilter):
    """The unscented Kalman filter: 2n + 1 points carry a Gaussian of n states through any nonlinear model, to second order.

    The points are scaled by `alpha`, `beta`, `kappa` as in `numerics.sigma_points.unscented`. The defaults suit float32, too; a
    small `alpha`, such as the usual 1e-3, does not. Julier & Uhlmann's first weights are alpha = 1, beta = 0. `form`: how the
    covariance is kept, such as `SquareRoot()`. Source: Julier & Uhlmann 2004; Sarkka 2013, sec. 5.6.

    **Raises** `InputError`, when it runs, if alpha^2 (n + kappa) is not positive.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    alpha: float = eqx.field(static=True, default=1.0)
    beta: float = eqx.field(static=True, default=2.0)
    kappa: float = eqx.field(static=True, default=0.0)
    form: AbstractForm = Covariance()

    def rule(self, n):
        return Points(sigma_points.unscented(n, self.alpha, self.beta, self.kappa))


class Simplex(AbstractRuleFilter):
    """The unscented filter with the fewest points: n+2, on a spherical simplex and at its centre (S. Julier 2003).

    `central`: weight of the point at the centre.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    central: float = eqx.field(static=True, default=0.0)
    form: AbstractForm = Covariance()

    def rule(self, n):
        return Points(sigma_points.spherical_simplex(n, self.central))


class Cubature(AbstractRuleFilter):
    """The cubature Kalman filter of `degree` 3 (2n points) or 5 (2n^2+1) (Arasaratnam & Haykin 2009; Jia, Xin & Cheng 2013)."""

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    degree: int = eqx.field(static=True, default=3)
    form: AbstractForm = Covariance()

    def rule(self, n):
        return Points(sigma_points.cubature(n, self.degree))


class GaussHermite(AbstractRuleFilter):
    """The Gauss-Hermite Kalman filter with `order` points per axis, order^n in all (Ito & Xiong 2000; Sarkka 2013, sec. 6.3)."""

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    order: int = eqx.field(static=True, default=3)
    form: AbstractForm = Covariance()

    def rule(self, n):
        return Points(sigma_points.gauss_hermite(n, self.order))


class SigmaPointFilter(AbstractRuleFilter):
    """A filter with sigma points of the caller's own: `points(n)` gives the `numerics.SigmaPoints` for n states."""

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    points: Callable[[int], sigma_points.SigmaPoints] = eqx.field(static=True)
    form: AbstractForm = Covariance()

    def __check_init__(self):
        if not callable(self.points):
            raise InputError(
                f"SigmaPointFilter.points = {word_for(self.points)}: must be a function of the number of states."
            )

    def rule(self, n):
        return Points(self.points(n))
