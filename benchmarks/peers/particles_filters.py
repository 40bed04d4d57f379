"""Kalman and particle filters of the `particles` library (Chopin), the latter with vectorised NumPy models on (N, n) arrays."""

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

__all__ = ["backward_sampling", "guided", "kalman", "particle_filter"]

LOG_2PI = float(np.log(2 * np.pi))


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

    The library resamples the array of particles, so the propagated states and their look-ahead are further columns of it.
    """

    def M0(self, N: int) -> np.ndarray:
        return self._ahead(super().M0(N), 0)

    def M(self, t: int, xp: np.ndarray) -> np.ndarray:
        p = self.problem
        return self._ahead(xp[:, 11:22] + p.process_std * self.rng.standard_normal((len(xp), 11)), t)

    def logG(self, t: int, xp: np.ndarray, x: np.ndarray) -> np.ndarray:
        return self.problem.log_likelihood(x[:, :11].T, t)  # the library itself subtracts the look-ahead

    def logeta(self, t: int, x: np.ndarray) -> np.ndarray:
        return x[:, 22]

    def _ahead(self, x: np.ndarray, t: int) -> np.ndarray:
        p = self.problem
        if t + 1 == p.rows:
            return np.concatenate([x, x, np.zeros((len(x), 1))], axis=1)
        ahead = p.transition(x.T, p.steer[t], p.speed[t])
        return np.concatenate([x, ahead.T, p.log_likelihood(ahead, t + 1)[:, None]], axis=1)


class _Always:
    """The first base class: resampling before every step."""

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


class _Linear(_Always, particles.FeynmanKac):
    """The bootstrap filter of a linear problem."""

    def __init__(self, plain: Plain, y: np.ndarray, seed: int) -> None:
        super().__init__(len(y))
        self.plain, self.y = plain, y
        self.spreads = [np.sqrt(np.diag(P)) for P in (plain.covariance, plain.process, plain.noise)]
        self.rng = np.random.default_rng(seed)

    def moved(self, t: int, xp: np.ndarray) -> np.ndarray:
        F, B, _, _ = self.plain.matrices
        return xp @ F.T + B @ self.plain.inputs[t]

    def innovation(self, t: int, x: np.ndarray) -> np.ndarray:
        _, _, H, D = self.plain.matrices
        return self.y[t] - D @ self.plain.inputs[t] - x @ H.T

    def M0(self, N: int) -> np.ndarray:
        return self.plain.mean + self.spreads[0] * self.rng.standard_normal((N, len(self.plain.mean)))

    def M(self, t: int, xp: np.ndarray) -> np.ndarray:
        return self.moved(t, xp) + self.spreads[1] * self.rng.standard_normal(xp.shape)

    def logG(self, t: int, xp: np.ndarray, x: np.ndarray) -> np.ndarray:
        return _log_normal(self.innovation(t, x) / self.spreads[2], self.spreads[2])

    def logpt(self, t: int, xp: np.ndarray, x: np.ndarray) -> np.ndarray:
        return _log_normal((x - self.moved(t, xp)) / self.spreads[1], self.spreads[1])


class _LinearGuided(_Linear):
    """Draws from the optimal proposal, whose gain and factor are the same for all particles."""

    def __init__(self, plain: Plain, y: np.ndarray, seed: int) -> None:
        super().__init__(plain, y, seed)
        H, Q = plain.matrices[2], plain.process
        self.gain = np.linalg.solve(H @ Q @ H.T + plain.noise, H @ Q).T
        self.factor = np.linalg.cholesky(Q - self.gain @ H @ Q)
        self.inverse = np.linalg.inv(self.factor)

    def M(self, t: int, xp: np.ndarray) -> np.ndarray:
        return self.centre(t, xp) + self.rng.standard_normal(xp.shape) @ self.factor.T

    def logG(self, t: int, xp: np.ndarray, x: np.ndarray) -> np.ndarray:
        weight = super().logG(t, xp, x)
        if t == 0:  # drawn from the prior
            return weight
        white = (x - self.centre(t, xp)) @ self.inverse.T
        return weight + self.logpt(t, xp, x) - _log_normal(white, np.diag(self.factor))

    def centre(self, t: int, xp: np.ndarray) -> np.ndarray:
        moved = self.moved(t, xp)
        return moved + self.innovation(t, moved) @ self.gain.T


def _log_normal(white: np.ndarray, scales: np.ndarray) -> np.ndarray:
    return -0.5 * np.sum(white**2 + LOG_2PI, axis=-1) - np.sum(np.log(scales))


def guided(plain: Plain, count: int) -> Callable[[np.ndarray, int], Result]:
    """The guided filter of a linear problem, resampled before every step, a function of measurements and seed."""

    def run(y: np.ndarray, seed: int) -> Result:
        means = collectors.Moments(mom_func=lambda W, X: W @ X)
        smc = _run(_LinearGuided(plain, y, seed), count, seed, collect=[means])
        return Result(np.array(smc.summaries.moments), smc.logLt)

    return run


def backward_sampling(
    plain: Plain, count: int, paths: int
) -> Callable[[np.ndarray, int], tuple[np.ndarray, np.ndarray, float]]:
    """The bootstrap filter of a linear problem and paths drawn backwards through its particles.

    A function of measurements and seed: means and standard deviations of the paths (rows, n), and the filter's log-likelihood.
    """

    def run(y: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
        smc = _run(_Linear(plain, y, seed), count, seed, store_history=True)
        drawn = np.array(smc.hist.backward_sampling(paths))
        return drawn.mean(axis=1), drawn.std(axis=1), smc.logLt

    return run


def _run(model: particles.FeynmanKac, count: int, seed: int, **settings: object) -> particles.SMC:
    np.random.seed(seed)  # noqa: NPY002  the library draws its resampling from NumPy's global state
    smc = particles.SMC(fk=model, N=count, resampling="systematic", **settings)
    smc.run()
    return smc
