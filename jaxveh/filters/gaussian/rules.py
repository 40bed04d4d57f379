"""Rules that approximate a function of a Gaussian: by its slopes at the mean, or by its values at sigma points."""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.own_results import of_kind
from jaxveh.numerics import as_whole, fence, sigma_points


class Image(NamedTuple):
    """A function's values under a Gaussian, as deviations whose products are covariances.

    `mean` (m,); `deviations` E (m, k) of the values; `spread` X (n, k), the deviations of the argument. With `signs` W
    (k,) of the rule's weights (None if all are positive):

        cov(y) = E W E^T,    cov(x, y) = X W E^T,    P = X W X^T.
    """

    mean: Any
    deviations: Any
    spread: Any
    signs: np.ndarray | None


class AbstractRule(Checked, eqx.Module):
    """A rule for `image(f, mean, factor)`, the image of the Gaussian with this mean (n,) and P = F F^T, F = `factor` (n, n).

    `f` maps coordinates as rows (n, ...) to values as rows (m, ...), elementwise along the axes after the first.
    """

    _contract = contract(image=of_kind(Image, numbers=False))

    # Not an `eqx.AbstractVar`: with postponed annotations that would be a field of the dataclass.
    @property
    @abc.abstractmethod
    def positive(self) -> bool:
        """Whether all weights of covariances are positive, as square-root forms need."""

    @property
    def amplification(self) -> float:
        """The factor by which rounding errors of a mean grow because weights of both signs cancel."""
        return 1.0

    @abc.abstractmethod
    def image(self, f: Callable, mean: Any, factor: Any) -> Image:
        """The mean and the deviations of the function `f`."""


class Slopes(AbstractRule):
    """The first-order Taylor polynomial at the mean: E = (df/dx) F, X = F (S. Sarkka, 2013, eq 5.26)."""

    @property
    def positive(self):
        return True

    def image(self, f, mean, factor):
        value, slope = jax.linearize(f, mean)
        return Image(value, jax.vmap(slope, in_axes=1, out_axes=1)(factor), factor, None)


class Points(AbstractRule):
    """Sigma points `mean + F xi_j`, with E_j = sqrt|w_j| (f_j - mean f) (S. Sarkka, 2013, eq 5.84).

    Two rules with equal numbers are equal, so that jit sees one structure.
    """

    points: sigma_points.SigmaPoints = eqx.field(static=True)

    @property
    def positive(self):
        return self._signs is None

    @property
    def amplification(self):
        return float(np.sum(np.abs(self.points.mean_weights)))

    @property
    def _signs(self):
        weights = np.asarray(self.points.covariance_weights)
        return None if (weights >= 0).all() else np.sign(weights)

    def image(self, f, mean, factor):
        dtype, points = mean.dtype, self.points
        root = jnp.asarray(np.sqrt(np.abs(points.covariance_weights)), dtype)
        steps = times(factor, jnp.asarray(points.directions, dtype))
        values = fence(as_whole(f)(fence(mean[:, None] + steps)))
        average = times(values, jnp.asarray(points.mean_weights, dtype))
        return Image(average, *fence(((values - average[:, None]) * root, steps * root)), self._signs)


def times(a: Any, b: Any) -> Any:
    """The matrix product (n, k) (k, m) or (n, k) (k,) as a sum that XLA can fuse.

    The matrix products of XLA's library round differently depending on where the operands lie in memory, so that a live
    loop would not give the bits of a scan. For few states they are also slower.
    """
    return jnp.sum(a * b, axis=-1) if b.ndim == 1 else jnp.sum(a[:, None, :] * b.T[None], axis=-1)


def spread_of(image: Image) -> Any:
    """The variances (m,) of an image; weights of both signs can leave one a little below zero."""
    squared = jnp.square(image.deviations)
    if image.signs is not None:
        squared = squared * jnp.asarray(image.signs, squared.dtype)
    return jnp.sum(squared, axis=-1)


def product(a: Any, b: Any, signs: np.ndarray | None) -> Any:
    """The product A W B^T (n, m) of deviations A (n, k) and B (m, k) with the signs W."""
    return times(a if signs is None else a * jnp.asarray(signs, a.dtype), b.T)
