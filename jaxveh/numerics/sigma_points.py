"""Sigma points: fixed directions and weights that represent a Gaussian in n dimensions."""

from __future__ import annotations

import itertools

import numpy as np

from jaxveh._core.errors import InputError

GREATEST = 20_000
"""The largest number of points of a rule; more are taken for a mistake."""


class SigmaPoints:
    """Unit directions (n, p) as columns, and the weights (p,) of means and of covariances; host-side float64.

    Two sets of equal numbers are equal, so that jit sees one structure.
    """

    def __init__(self, directions: np.ndarray, mean_weights: np.ndarray, covariance_weights: np.ndarray | None = None):
        self.directions, self.mean_weights = directions, mean_weights
        self.covariance_weights = mean_weights if covariance_weights is None else covariance_weights
        arrays = (self.directions, self.mean_weights, self.covariance_weights)
        self._key = tuple((array.shape, array.tobytes()) for array in arrays)

    def __eq__(self, other):
        return isinstance(other, SigmaPoints) and self._key == other._key

    def __hash__(self):
        return hash(self._key)


def unscented(n: int, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> SigmaPoints:
    """The scaled unscented transform's 2n+1 points (Wan & van der Merwe 2000; Sarkka 2013, eqs 5.74 to 5.77).

    `lambda = alpha^2 (n + kappa) - n`; points at 0 and +/- sqrt(n + lambda) along each axis; weights
    `w_m0 = lambda / (n + lambda)`, `w_c0 = w_m0 + 1 - alpha^2 + beta`, the others `1 / (2 (n + lambda))`. Julier & Uhlmann's
    first set is alpha = 1, beta = 0, with kappa = 3 - n for Gaussians. A small alpha makes w_m0 huge and negative and ruins
    float32: the default is 1.
    """
    spread = alpha**2 * (n + kappa)
    if not spread > 0:
        raise InputError(f"alpha^2 (n + kappa) = {spread}: must be positive (n = {n}, kappa = {kappa}).")
    directions = np.sqrt(spread) * np.hstack([np.zeros((n, 1)), np.eye(n), -np.eye(n)])
    mean_weights = np.full(2 * n + 1, 1 / (2 * spread))
    mean_weights[0] = (spread - n) / spread
    covariance_weights = mean_weights.copy()
    covariance_weights[0] += 1 - alpha**2 + beta
    return SigmaPoints(directions, mean_weights, covariance_weights)


def spherical_simplex(n: int, central: float = 0.0) -> SigmaPoints:
    """n+2 points: one at 0 of weight `central`, and a regular simplex on a sphere (S. Julier 2003)."""
    if not 0 <= central < 1:
        raise InputError(f"central = {central}: must be at least 0 and below 1.")
    weight = (1 - central) / (n + 1)
    simplex = np.array([[-1.0, 1.0]])
    for j in range(2, n + 1):
        last = np.append(np.full(j, -1.0), float(j))
        simplex = np.vstack([np.hstack([simplex, np.zeros((j - 1, 1))]), last / np.sqrt(j * (j + 1) / 2)])
    # The squares of each row of the simplex sum to 2; the weights reduce this to 1.
    directions = np.hstack([np.zeros((n, 1)), simplex / np.sqrt(2 * weight)])
    return SigmaPoints(directions, np.append(central, np.full(n + 1, weight)))


def cubature(n: int, degree: int = 3) -> SigmaPoints:
    """The spherical-radial rule exact for polynomials of `degree` 3 (2n points) or 5 (2n^2+1 points).

    Degree 3: +/- sqrt(n) along each axis (I. Arasaratnam & S. Haykin 2009). Degree 5: the centre with weight 2 / (n + 2),
    +/- sqrt(n+2) along each axis with (4 - n) / (2 (n+2)^2), and along each pair of axes with 1 / (n+2)^2 (J. McNamee &
    F. Stenger 1967; B. Jia, M. Xin & Y. Cheng 2013); it has negative weights from n = 5 on.
    """
    if degree not in (3, 5):
        raise InputError(f"degree = {degree}: must be 3 or 5.")
    axes = np.hstack([np.eye(n), -np.eye(n)])
    if degree == 3:
        return SigmaPoints(np.sqrt(n) * axes, np.full(2 * n, 1 / (2 * n)))
    pairs = [
        a * np.eye(n)[i] + b * np.eye(n)[j]
        for i, j in itertools.combinations(range(n), 2)
        for a, b in itertools.product((1, -1), repeat=2)
    ]
    diagonal = np.sqrt((n + 2) / 2) * np.reshape(pairs, (-1, n)).T
    directions = np.hstack([np.zeros((n, 1)), np.sqrt(n + 2) * axes, diagonal])
    weights = np.r_[2 / (n + 2), np.full(2 * n, (4 - n) / (2 * (n + 2) ** 2)), np.full(len(pairs), 1 / (n + 2) ** 2)]
    return SigmaPoints(directions, weights)


def gauss_hermite(n: int, order: int = 3) -> SigmaPoints:
    """The product of n Gauss-Hermite rules of `order` points each, exact to degree `2 order - 1` along each axis: order^n points
    (K. Ito & K. Xiong 2000; Sarkka 2013, eq 6.25)."""
    if order < 2:
        raise InputError(f"order = {order}: must be at least 2.")
    if order**n > GREATEST:
        raise InputError(f"{order}^{n} = {order**n} points: must be at most {GREATEST}; take Cubature or Unscented.")
    nodes, weights = np.polynomial.hermite_e.hermegauss(order)
    directions = np.array(list(itertools.product(nodes, repeat=n))).T
    products = np.prod(list(itertools.product(weights / weights.sum(), repeat=n)), axis=1)
    return SigmaPoints(directions, products)
