"""The filters of `filterpy`: one run, a Python loop over rows and sigma points."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from filterpy.hinfinity import HInfinityFilter
from filterpy.kalman import (
    CubatureKalmanFilter,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    FixedLagSmoother,
    IMMEstimator,
    KalmanFilter,
    MerweScaledSigmaPoints,
    SquareRootKalmanFilter,
    UnscentedKalmanFilter,
)
from filterpy.kalman.CubatureKalmanFilter import spherical_radial_sigmas

from ..problems import SpeedAndMass
from .numpy_filters import Result

if TYPE_CHECKING:
    from ..plain import Plain

__all__ = [
    "cubature",
    "ensemble",
    "extended",
    "fixed_lag",
    "h_infinity",
    "interacting",
    "kalman",
    "kalman_smoother",
    "square_root",
    "unscented",
    "unscented_filter",
]

Arrays = tuple[np.ndarray, np.ndarray, float]


def unscented(problem: SpeedAndMass) -> Callable[[], Result]:
    """The unscented filter of the first run."""
    p = problem

    def transition(x: np.ndarray, dt: float, torque: float) -> np.ndarray:
        v, mass, grade = x
        constant = torque / (p.wheel_radius * mass)
        constant -= p.gravity * (p.rolling_resistance * math.cos(grade) + math.sin(grade))
        drag = p.drag / mass
        k1 = constant - drag * v * v
        k2 = constant - drag * (v + dt / 2 * k1) ** 2
        k3 = constant - drag * (v + dt / 2 * k2) ** 2
        k4 = constant - drag * (v + dt * k3) ** 2
        return np.array([v + dt / 6 * (k1 + 2 * (k2 + k3) + k4), mass, grade])

    def run() -> Result:
        points = MerweScaledSigmaPoints(3, p.alpha, p.beta, p.kappa)
        ukf = UnscentedKalmanFilter(3, 1, p.step, hx=lambda x: x[:1], fx=transition, points=points)
        ukf.x, ukf.P = p.prior_mean.copy(), np.diag(p.prior_std**2)
        ukf.Q, ukf.R = np.diag(p.process_std**2), np.array([[p.speed_std**2]])
        means, log_likelihood = np.empty((p.rows, 3, 1)), 0.0
        for k in range(p.rows):
            if k:
                ukf.predict(torque=p.torque[k - 1])
            else:
                ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
            ukf.update(p.speed[k, :1])
            means[k, :, 0] = ukf.x
            log_likelihood += ukf.log_likelihood
        return Result(means, np.array([log_likelihood]))

    return run


def kalman(plain: Plain) -> Callable[[np.ndarray], Arrays]:
    """The Kalman filter of measurements (rows, m): means, spreads, log-likelihood."""
    return lambda y: _shown(_kalman_loop(plain, y)[1:])


def kalman_smoother(plain: Plain) -> Callable[[np.ndarray], Arrays]:
    """Its Rauch-Tung-Striebel smoother, which has no inputs: it smooths the motion without them.

    The work is exactly the same, but the means are not those of the problem.
    """

    def run(y: np.ndarray) -> Arrays:
        kf, means, covariances, total = _kalman_loop(plain, y)
        means, covariances, *_ = kf.rts_smoother(means[:, :, None], covariances)
        return _shown((means[:, :, 0], covariances, total))

    return run


def _kalman_loop(plain: Plain, y: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, float]:
    n, D = len(plain.mean), plain.matrices[3]
    kf = _kalman_filter(plain)
    means, covariances, total = np.empty((len(y), n)), np.empty((len(y), n, n)), 0.0
    for k, u in enumerate(plain.inputs):
        if k:
            kf.predict(u[:, None])
        kf.update((y[k] - D @ u)[:, None])
        means[k], covariances[k] = kf.x[:, 0], kf.P
        total += kf.log_likelihood
    return kf, means, covariances, total


def _kalman_filter(plain: Plain) -> KalmanFilter:
    F, B, H, _ = plain.matrices
    kf = KalmanFilter(H.shape[1], H.shape[0], dim_u=B.shape[1])
    kf.x, kf.P, kf.F, kf.B, kf.H = plain.mean[:, None].copy(), plain.covariance.copy(), F, B, H
    kf.Q, kf.R = plain.process, plain.noise
    return kf


def interacting(plain: Plain, levels: tuple[float, ...], stay: float) -> Callable[[np.ndarray], Arrays]:
    """Interacting multiple models: Kalman filters whose process noise has these levels of standard deviation.

    A mode stays with probability `stay`, and otherwise changes to any other with equal probability.
    """
    n, D, modes = len(plain.mean), plain.matrices[3], len(levels)
    change = np.full((modes, modes), (1 - stay) / (modes - 1))
    np.fill_diagonal(change, stay)

    def run(y: np.ndarray) -> Arrays:
        each = [_kalman_filter(plain) for _ in levels]
        for kf, level in zip(each, levels, strict=True):
            kf.Q = level**2 * plain.process
        imm = IMMEstimator(each, np.full(modes, 1 / modes), change)
        means, covariances, total = np.empty((len(y), n)), np.empty((len(y), n, n)), 0.0
        for k, u in enumerate(plain.inputs):
            if k:
                imm.predict(u[:, None])
            before = imm.cbar  # in the first row the modes' probabilities, which start equal
            imm.update((y[k] - D @ u)[:, None])
            means[k], covariances[k] = imm.x[:, 0], imm.P
            total += math.log(before @ imm.likelihood)
        return _shown((means, covariances, total))

    return run


def h_infinity(plain: Plain, bound: float, weights: list[float]) -> Callable[[np.ndarray], Arrays]:
    """The H-infinity filter, about which the library itself warns.

    Its prediction does not propagate the covariance, and its update propagates the predicted state again. With F = 1 and no
    process noise the update is right, and the loop does the prediction.
    """
    F, B, H, D = plain.matrices
    n, m = H.shape[1], H.shape[0]

    def run(y: np.ndarray) -> Arrays:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            found = HInfinityFilter(n, m, B.shape[1], bound)
        found.x, found.P, found.H = plain.mean[:, None].copy(), plain.covariance, H
        found.Q, found.V = np.diag(weights), plain.noise
        means, covariances = np.empty((len(y), n)), np.empty((len(y), n, n))
        for k, u in enumerate(plain.inputs):
            if k:
                found.x, found.P = F @ found.x + B @ u[:, None], F @ found.P @ F.T + plain.process
            found.update((y[k] - D @ u)[:, None])
            means[k], covariances[k] = found.x[:, 0], found.P
        return _shown((means, covariances, math.nan))

    return run


def fixed_lag(plain: Plain, lag: int) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Means (rows, n) of the fixed-lag smoother, and those of the filter in it.

    The former are not those of a correct smoother: its gains use the covariance after the measurement instead of that before it.
    """
    F, B, H, D = plain.matrices

    def run(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = FixedLagSmoother(H.shape[1], H.shape[0])
        found.F, found.B, found.H, found.Q, found.R = F, B, H, plain.process, plain.noise
        # It also predicts before the first measurement: this start is predicted to the prior.
        back = np.linalg.inv(F)
        found.x = back @ (plain.mean - B @ plain.inputs[0])[:, None]
        found.P = back @ (plain.covariance - plain.process) @ back.T
        smoothed, filtered = found.smooth_batch((y - plain.inputs @ D.T)[:, :, None], lag, plain.inputs[:, :, None])
        return smoothed[:, :, 0], filtered[:, :, 0]

    return run


def square_root(plain: Plain) -> Callable[[np.ndarray], Arrays]:
    """The square-root Kalman filter, which has no log-likelihood."""
    F, B, H, D = plain.matrices
    n, m = H.shape[1], H.shape[0]

    def run(y: np.ndarray) -> Arrays:
        kf = SquareRootKalmanFilter(n, m, dim_u=B.shape[1])
        kf.x, kf.P, kf.F, kf.B, kf.H = plain.mean[:, None].copy(), plain.covariance, F, B, H
        kf.Q, kf.R = plain.process, plain.noise
        means, covariances = np.empty((len(y), n)), np.empty((len(y), n, n))
        for k, u in enumerate(plain.inputs):
            if k:
                kf.predict(u[:, None])
            kf.update((y[k] - D @ u)[:, None])
            means[k], covariances[k] = kf.x[:, 0], kf.P
        return _shown((means, covariances, math.nan))

    return run


class _Extended(ExtendedKalmanFilter):
    """Propagates the mean by a function, in the method that the library asks users to override."""

    def predict_x(self, u: Any = 0) -> None:
        self.x = self.move(self.x, u)


def extended(plain: Plain) -> Callable[[np.ndarray], Arrays]:
    """The extended Kalman filter, with Jacobians by central differences: the library leaves them to the user."""
    n, m = len(plain.mean), len(plain.noise)
    reach = 1e-4 * np.sqrt(np.diag(plain.covariance))

    def slope(f: Callable, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        step = np.diag(reach)
        # All points at once, as columns: the functions are elementwise in what follows the first axis.
        there = f(np.concatenate([x[:, None] + step, x[:, None] - step], axis=1), u)
        return (there[:, :n] - there[:, n:]) / (2 * reach)

    def run(y: np.ndarray) -> Arrays:
        ekf = _Extended(n, m)
        ekf.move = plain.moved
        ekf.x, ekf.P, ekf.Q, ekf.R = plain.mean.copy(), plain.covariance.copy(), plain.process, plain.noise
        means, covariances, total = np.empty((len(y), n)), np.empty((len(y), n, n)), 0.0
        for k, u in enumerate(plain.inputs):
            if k:
                ekf.F = slope(plain.moved, ekf.x, u)
                ekf.predict(u)
            ekf.update(y[k], lambda x, u: slope(plain.seen, x, u), plain.seen, args=(u,), hx_args=(u,))
            means[k], covariances[k] = ekf.x, ekf.P
            total += ekf.log_likelihood
        return _shown((means, covariances, total))

    return run


def unscented_filter(plain: Plain) -> Callable[[np.ndarray], Arrays]:
    """The unscented filter with alpha = 1, beta = 2, kappa = 0."""
    n, m = len(plain.mean), len(plain.noise)

    def run(y: np.ndarray) -> Arrays:
        points = MerweScaledSigmaPoints(n, 1.0, 2.0, 0.0)
        ukf = UnscentedKalmanFilter(
            n, m, 1.0, hx=lambda x, u: plain.seen(x, u), fx=lambda x, dt, u: plain.moved(x, u), points=points
        )
        ukf.x, ukf.P, ukf.Q, ukf.R = plain.mean.copy(), plain.covariance.copy(), plain.process, plain.noise
        means, covariances, total = np.empty((len(y), n)), np.empty((len(y), n, n)), 0.0
        for k, u in enumerate(plain.inputs):
            if k:
                ukf.predict(u=u)
            else:
                ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
            ukf.update(y[k], u=u)
            means[k], covariances[k] = ukf.x, ukf.P
            total += ukf.log_likelihood
        return _shown((means, covariances, total))

    return run


def cubature(plain: Plain, *, regenerate: bool = False) -> Callable[[np.ndarray], Arrays]:
    """The cubature filter. Its update keeps the points from before the process noise; ``regenerate`` makes new ones."""
    n, m = len(plain.mean), len(plain.noise)

    def run(y: np.ndarray) -> Arrays:
        ckf = CubatureKalmanFilter(n, m, 1.0, hx=plain.seen, fx=lambda x, dt, u: plain.moved(x, u))
        ckf.x, ckf.P, ckf.Q, ckf.R = plain.mean[:, None].copy(), plain.covariance.copy(), plain.process, plain.noise
        means, covariances, total = np.empty((len(y), n)), np.empty((len(y), n, n)), 0.0
        for k, u in enumerate(plain.inputs):
            if k:
                ckf.predict(fx_args=(u,))
            if k == 0 or regenerate:
                ckf.sigmas_f = spherical_radial_sigmas(ckf.x, ckf.P)
            ckf.update(y[k][:, None], hx_args=(u,))
            means[k], covariances[k] = ckf.x.ravel(), ckf.P
            total += ckf.log_likelihood
        return _shown((means, covariances, total))

    return run


def ensemble(plain: Plain, members: int) -> Callable[[np.ndarray], Arrays]:
    """The ensemble filter with perturbed measurements; it draws from NumPy's global generator."""

    def run(y: np.ndarray, key: object = None) -> Arrays:
        del key
        now = [plain.inputs[0]]
        enkf = EnsembleKalmanFilter(
            plain.mean.copy(),
            plain.covariance,
            len(plain.noise),
            1.0,
            members,
            hx=lambda x: plain.seen(x, now[0]),
            fx=lambda x, dt: plain.moved(x, now[0]),
        )
        enkf.Q, enkf.R = plain.process, plain.noise
        means, covariances = np.empty((len(y), len(plain.mean))), np.empty((len(y), *plain.covariance.shape))
        for k, u in enumerate(plain.inputs):
            now[0] = u
            if k:
                enkf.predict()
            enkf.update(y[k])
            means[k], covariances[k] = enkf.x, enkf.P
        return _shown((means, covariances, math.nan))

    return run


def _shown(done: tuple[np.ndarray, np.ndarray, float]) -> Arrays:
    means, covariances, total = done
    return means, np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)), total
