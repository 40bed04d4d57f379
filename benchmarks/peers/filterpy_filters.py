"""The unscented filter of `filterpy`: one run, a Python loop over rows and sigma points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from ..problems import SpeedAndMass
from .numpy_filters import Result

__all__ = ["unscented"]


def unscented(problem: SpeedAndMass) -> Callable[[], Result]:
    """The filter of the first run."""
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
