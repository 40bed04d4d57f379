"""Kalman and particle filters of the `particles` library (Chopin), the latter with vectorised NumPy models on (N, 11) arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import particles
from particles import collectors
from particles import kalman as exact

from ..problems import SingleTrack
from .numpy_filters import Result

if TYPE_CHECKING:
    from ..plain import Plain

__all__ = ["kalman", "particle_filter"]


def kalman(plain: Plain) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, float]]:
    """The Kalman filter of measurements (rows, m): means, spreads, log-likelihood; inputs are added between its steps."""
    F, B, H, D = plain.matrices

    def run(y: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        means, covariances = np.empty((len(y), len(F))), np.empty((len(y), *F.shape))
        belief, total = exact.MeanAndCov(plain.mean, plain.covariance), 0.0
        for k, u in enumerate(plain.inputs):
            if k:
                moved = exact.predict_step(F, plain.process, belief)
                belief = exact.MeanAndCov(moved.mean + B @ u, moved.cov)
            belief, log_likelihood = exact.filter_step(H, plain.noise, belief, y[k] - D @ u)
            means[k], covariances[k] = belief.mean, belief.cov
            total += float(log_likelihood)
        return means, np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)), total

    return run


class _Bootstrap(particles.FeynmanKac):
    """The bootstrap filter: draws from the transition, weighed by the likelihood."""

    def __init__(self, problem: SingleTrack, seed: int) -> None:
        super().__init__(problem.rows)
        self.problem = problem
        self.rng = np.random.default_rng(seed)

    def M0(self, N: int) -> np.ndarray:
        return self.problem.prior_mean + self.problem.prior_std * self.rng.standard_normal((N, 11))

    def M(self, t: int, xp: np.ndarray) -> np.ndarray:
        p = self.problem
        moved = p.transition(xp.T, p.steer[t - 1], p.speed[t - 1]).T
        return moved + p.process_std * self.rng.standard_normal(xp.shape)

    def logG(self, t: int, xp: np.ndarray, x: np.ndarray) -> np.ndarray:
        return self.problem.log_likelihood(x.T, t)


class _Auxiliary(_Bootstrap):
    """Looks ahead with the state propagated without noise, which is computed once.

    The library resamples the array of particles, so the propagated states and their look-ahead travel as further columns.
    """

    def M0(self, N: int) -> np.ndarray:
        return self._ahead(super().M0(N), 0)

    def M(self, t: int, xp: np.ndarray) -> np.ndarray:
        p = self.problem
        return self._ahead(xp[:, 11:22] + p.process_std * self.rng.standard_normal((len(xp), 11)), t)

    def logG(self, t: int, xp: np.ndarray, x: np.ndarray) -> np.ndarray:
        return self.problem.log_likelihood(x[:, :11].T, t)  # the library takes the look-ahead off itself

    def logeta(self, t: int, x: np.ndarray) -> np.ndarray:
        return x[:, 22]

    def _ahead(self, x: np.ndarray, t: int) -> np.ndarray:
        p = self.problem
        if t + 1 == p.rows:
            return np.concatenate([x, x, np.zeros((len(x), 1))], axis=1)
        ahead = p.transition(x.T, p.steer[t], p.speed[t])
        return np.concatenate([x, ahead.T, p.log_likelihood(ahead, t + 1)[:, None]], axis=1)


class _Always:
    """Mixed in first: resample before every step."""

    def time_to_resample(self, smc: particles.SMC) -> bool:
        return True


class _AlwaysBootstrap(_Always, _Bootstrap):
    pass


class _AlwaysAuxiliary(_Always, _Auxiliary):
    pass


def particle_filter(problem: SingleTrack, count: int, *, auxiliary: bool) -> Callable[[int], Result]:
    """A bootstrap or auxiliary particle filter as a function of the seed."""

    def run(seed: int) -> Result:
        np.random.seed(seed)  # noqa: NPY002  the library draws its resampling from NumPy's global state
        model = (_AlwaysAuxiliary if auxiliary else _AlwaysBootstrap)(problem, seed)
        means = collectors.Moments(mom_func=lambda W, X: W @ X[:, :11])
        smc = particles.SMC(fk=model, N=count, resampling="systematic", collect=[means])
        smc.run()
        return Result(np.array(smc.summaries.moments), smc.logLt)

    return run
