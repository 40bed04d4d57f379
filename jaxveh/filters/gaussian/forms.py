"""The forms in which a Gaussian filter stores its covariance: the matrix, a triangular factor, or a factor of singular
vectors."""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.filters.gaussian.noises import covariance_in, factor_in
from jaxveh.filters.gaussian.rules import Image, product, times
from jaxveh.statespace import AbstractNoise


class Spread(NamedTuple):
    """A `factor` F of a covariance P (n, n), with P = F F^T, and P itself as `matrix` if the form stores it, otherwise None."""

    factor: Any
    matrix: Any


class Conditioned(NamedTuple):
    """A Gaussian conditioned on a measurement: the lower factor of the innovation's covariance (m, m), the innovation
    whitened by it, `white` (m,), the `shift` (n,) of the mean, and the `spread` after the measurement."""

    innovation_factor: Any
    white: Any
    shift: Any
    spread: Spread


class Later(NamedTuple):
    """The smoothed Gaussian after a transition: its mean less the predicted mean, `shift` (n,), and its `spread`."""

    shift: Any
    spread: Spread


class Smoothed(NamedTuple):
    """The `shift` (n,) of the mean by the later measurements, the smoothed `spread`, and the smoother's `gain` (n, n)."""

    shift: Any
    spread: Spread
    gain: Any


class AbstractForm(eqx.Module):
    """The algebra of a filter's covariances.

    A form declares its properties, which are False by default:

    - `negative_weights`: it takes rules with negative weights.
    - `keeps_matrix`: each `Spread` has the covariance as its `matrix`.
    - `triangular`: each factor is lower triangular.
    - `differentiable`: its values have correct derivatives.
    """

    negative_weights: ClassVar[bool] = False
    keeps_matrix: ClassVar[bool] = False
    triangular: ClassVar[bool] = False
    differentiable: ClassVar[bool] = False

    @abc.abstractmethod
    def start(self, covariance: Any) -> Spread:
        """The `Spread` of a covariance (n, n)."""

    @abc.abstractmethod
    def add(self, image: Image, law: AbstractNoise | None, fields: tuple[str, ...]) -> Spread:
        """E W E^T + Q, with the noise of `law` on some of the `fields` of the image's values."""

    @abc.abstractmethod
    def condition(
        self, image: Image, law: AbstractNoise, fields: tuple[str, ...], here: Any, innovation: Any, before: Spread
    ) -> Conditioned:
        """The Gaussian `before`, conditioned on an innovation (m,) of those `fields` that are `here` (m,).

        A missing channel has an independent error of unit variance and zero innovation, so that it changes nothing. The
        image's deviations must be zero there.
        """

    @abc.abstractmethod
    def smooth(
        self, image: Image, law: AbstractNoise | None, fields: tuple[str, ...], before: Spread, later: Later
    ) -> Smoothed:
        """The Gaussian `before` a transition with this image, given the smoothed Gaussian `later` of the state after it.

        (H. Rauch, F. Tung & C. Striebel 1965; S. Sarkka, 2013, eqs 8.6 and 10.1.)
        """


class Covariance(AbstractForm):
    """The covariance itself, with its Cholesky factor for the points: the fastest form.

    S = E W E^T + R,    K = X W E^T S^-1,    P+ = P - K S K^T
    """

    negative_weights: ClassVar[bool] = True
    keeps_matrix: ClassVar[bool] = True
    triangular: ClassVar[bool] = True
    differentiable: ClassVar[bool] = True

    def start(self, covariance):
        return Spread(numerics.cholesky(covariance), covariance)

    def add(self, image, law, fields):
        covariance = product(image.deviations, image.deviations, image.signs)
        if law is not None:
            covariance = covariance + covariance_in(law, fields, covariance.dtype)
        return self.start(covariance)

    def condition(self, image, law, fields, here, innovation, before):
        E, X = image.deviations, image.spread
        both = here[:, None] & here[None, :]
        noise = jnp.where(both, covariance_in(law, fields, E.dtype), jnp.eye(len(fields), dtype=E.dtype))
        factor = numerics.cholesky(product(E, E, image.signs) + noise)
        white = numerics.solve_lower(factor, innovation)
        gain = numerics.solve_lower(factor, product(E, X, image.signs))
        covariance = before.matrix - times(gain.T, gain)
        return Conditioned(factor, white, times(gain.T, white), self.start(covariance))

    def smooth(self, image, law, fields, before, later):
        predicted = self.add(image, law, fields)
        cross = product(image.deviations, image.spread, image.signs)
        gain = numerics.solve_psd(predicted.factor, cross).T
        change = later.spread.matrix - predicted.matrix
        covariance = before.matrix + times(times(gain, change), gain.T)
        return Smoothed(times(gain, later.shift), self.start(numerics.symmetric(covariance)), gain)


class SquareRoot(AbstractForm):
    """A lower triangular factor instead of the covariance, which stays positive definite under rounding, also in float32.

    Array algorithms, each one triangularisation (P. Kaminski, A. Bryson & S. Schmidt 1971; T. Kailath, A. Sayed & B. Hassibi,
    Linear Estimation, sec. 12.1), with N the noise's factor:

        [E  N] -> F,        [E  N]    [S    0 ]
                            [X  0] -> [K S  F+]
    """

    triangular: ClassVar[bool] = True
    differentiable: ClassVar[bool] = True

    def start(self, covariance):
        return Spread(numerics.cholesky(covariance), None)

    def add(self, image, law, fields):
        return Spread(numerics.lower_factor(_wide(_with_noise(image.deviations, law, fields))), None)

    def condition(self, image, law, fields, here, innovation, before):
        E, X = image.deviations, image.spread
        m, n = len(fields), X.shape[0]
        array = jnp.block([[E, masked_factor(law, fields, here, E.dtype)], [X, jnp.zeros((n, m), E.dtype)]])
        whole = numerics.lower_factor(_wide(array))
        factor, gain = whole[:m, :m], whole[m:, :m]
        white = numerics.solve_lower(factor, innovation)
        return Conditioned(factor, white, times(gain, white), Spread(whole[m:, m:], None))

    def smooth(self, image, law, fields, before, later):
        X = image.spread
        n = X.shape[0]
        above = _with_noise(image.deviations, law, fields)
        below = jnp.pad(X, ((0, 0), (0, above.shape[1] - X.shape[1])))
        # The earlier state is conditioned on the later one, as on a measurement. To the rest of its covariance, the
        # smoothed covariance of the later state is added by the gain.
        whole = numerics.lower_factor(_wide(jnp.concatenate([above, below])))
        gain = numerics.solve_lower_transposed(whole[:n, :n], whole[n:, :n].T).T
        factor = numerics.lower_factor(jnp.concatenate([whole[n:, n:], times(gain, later.spread.factor)], axis=1))
        return Smoothed(times(gain, later.shift), Spread(factor, None), gain)


class SingularValues(AbstractForm):
    """The factor U sqrt(D) of the covariance's singular value decomposition U D U^T, from which the federated cubature
    filter of Ji, Li & Fan takes its points.

    The deviations are decomposed, not the covariance. If singular values coincide, their vectors are undefined, and so
    are the points for nonlinear functions and the derivatives: this form cannot be differentiated.
    """

    def start(self, covariance):
        return Spread(_principal(numerics.cholesky(covariance)), None)

    def add(self, image, law, fields):
        return Spread(_principal(_wide(_with_noise(image.deviations, law, fields))), None)

    def condition(self, image, law, fields, here, innovation, before):
        E, X = image.deviations, image.spread
        noise = masked_factor(law, fields, here, E.dtype)
        factor = numerics.lower_factor(jnp.concatenate([E, noise], axis=1))
        gain = numerics.solve_lower_transposed(factor, numerics.solve_lower(factor, product(E, X, None))).T
        white = numerics.solve_lower(factor, innovation)
        # Joseph's form: (X - K E) (X - K E)^T + K R K^T.
        after = jnp.concatenate([X - times(gain, E), times(gain, noise)], axis=1)
        return Conditioned(factor, white, times(gain, innovation), Spread(_principal(_wide(after)), None))

    def smooth(self, image, law, fields, before, later):
        E, X = image.deviations, image.spread
        both = _with_noise(E, law, fields)
        lower = numerics.lower_factor(_wide(both))
        gain = numerics.solve_psd(lower, product(E, X, None)).T
        noise = times(gain, both[:, E.shape[1] :])
        after = jnp.concatenate([X - times(gain, E), noise, times(gain, later.spread.factor)], axis=1)
        return Smoothed(times(gain, later.shift), Spread(_principal(_wide(after)), None), gain)


def _with_noise(deviations, law, fields):
    """The deviations (n, k) next to the noise's factor, which has one column per field with noise."""
    if law is None:
        return deviations
    return jnp.concatenate([deviations, factor_in(law, fields, deviations.dtype)], axis=1)


def masked_factor(law, fields, here, dtype):
    """A lower factor (m, m) of the measurement noise; a missing channel has independent noise of unit variance."""
    both = here[:, None] & here[None, :]
    return numerics.cholesky(jnp.where(both, covariance_in(law, fields, dtype), jnp.eye(len(fields), dtype=dtype)))


def _wide(matrix):
    """The matrix with columns of zeros added until it has as many columns as rows."""
    short = matrix.shape[0] - matrix.shape[1]
    return matrix if short <= 0 else jnp.pad(matrix, ((0, 0), (0, short)))


def _principal(matrix):
    """U D (n, n) of A = U D V^T."""
    vectors, values, _ = jnp.linalg.svd(matrix, full_matrices=False)
    return vectors * values
