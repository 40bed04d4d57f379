"""Sigma points: fixed directions and weights that stand for a Gaussian in n dimensions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError


class SigmaPoints(NamedTuple):
    """Unit directions (n, p) as columns, and the weights (p,) of means and of covariances; host-side float64."""

    directions: np.ndarray
    mean_weights: np.ndarray
    covariance_weights: np.ndarray


def unscented(n: int, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> SigmaPoints:
    """The scaled unscented transform's 2n+1 points (Wan & van der Merwe 2000; Sarkka 2013, eqs 5.74 to 5.77).

    `lambda = alpha^2 (n + kappa) - n`; points at 0 and +/- sqrt(n + lambda) along each axis; weights
    `w_m0 = lambda / (n + lambda)`, `w_c0 = w_m0 + 1 - alpha^2 + beta`, the others `1 / (2 (n + lambda))`.
    A small alpha makes w_m0 huge and negative and ruins float32: the default is 1.
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
