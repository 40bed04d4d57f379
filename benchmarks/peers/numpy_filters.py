"""Vectorised NumPy filters, as one would write them without a library, and the reference for the results of the limit."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..problems import SingleTrack, SpeedAndMass

__all__ = ["Result", "particle_filter", "unscented"]


class Result(NamedTuple):
    """Means, (rows, 11) or (rows, 3, runs), and log-likelihood, a number or (runs,)."""

    mean: np.ndarray
    log_likelihood: np.ndarray


def _normalised(log_weight: np.ndarray) -> tuple[np.ndarray, float]:
    largest = log_weight.max()
    weight = np.exp(log_weight - largest)
    total = weight.sum()
    return weight / total, largest + np.log(total)


def _systematic(rng: np.random.Generator, weight: np.ndarray) -> np.ndarray:
    n = len(weight)
    points = (rng.random() + np.arange(n)) / n
    return np.minimum(np.searchsorted(np.cumsum(weight), points), n - 1)


def particle_filter(problem: SingleTrack, particles: int, *, auxiliary: bool) -> Callable[[int], Result]:
    """A bootstrap or auxiliary particle filter as a function of the seed; particles are the last axis."""
    p, n = problem, particles

    def noise(rng: np.random.Generator, std: np.ndarray) -> np.ndarray:
        return std[:, None] * rng.standard_normal((11, n), std.dtype)

    def run(seed: int) -> Result:
        rng = np.random.default_rng(seed)
        mean = np.empty((p.rows, 11))
        x = p.prior_mean[:, None] + noise(rng, p.prior_std)
        log_weight = p.log_likelihood(x, 0)
        weight, log_total = _normalised(log_weight)
        mean[0] = x @ weight
        log_likelihood = log_total - np.log(n)
        for k in range(1, p.rows):
            if auxiliary:
                ahead = p.transition(x, p.steer[k - 1], p.speed[k - 1])
                look_ahead = p.log_likelihood(ahead, k)
                first, log_first = _normalised(log_weight + look_ahead)
                ancestors = _systematic(rng, first)
                x = ahead[:, ancestors] + noise(rng, p.process_std)
                log_likelihood += log_first - log_total
                log_weight = p.log_likelihood(x, k) - look_ahead[ancestors]
            else:
                x = x[:, _systematic(rng, weight)]
                x = p.transition(x, p.steer[k - 1], p.speed[k - 1]) + noise(rng, p.process_std)
                log_weight = p.log_likelihood(x, k)
            weight, log_total = _normalised(log_weight)
            log_likelihood += log_total - np.log(n)
            mean[k] = x @ weight
        return Result(mean, log_likelihood)

    return run


def unscented(problem: SpeedAndMass) -> Callable[[], Result]:
    """The unscented filter of all runs at once: matrices (runs, 3, 3), points (runs, 3, 7)."""
    p, n = problem, 3
    scaled = p.alpha**2 * (n + p.kappa)
    mean_weight = np.full(2 * n + 1, 0.5 / scaled, p.speed.dtype)
    cov_weight = mean_weight.copy()
    mean_weight[0] = 1 - n / scaled
    cov_weight[0] = 1 - n / scaled + 1 - p.alpha**2 + p.beta
    directions = np.sqrt(np.array(scaled, p.speed.dtype)) * np.concatenate(
        [np.zeros((n, 1)), np.eye(n), -np.eye(n)], axis=1, dtype=p.speed.dtype
    )

    def draw(mean: np.ndarray, cov: np.ndarray) -> np.ndarray:
        return mean[:, :, None] + np.linalg.cholesky(cov) @ directions

    def run() -> Result:
        m = np.tile(p.prior_mean, (p.runs, 1))
        cov = np.tile(np.diag(p.prior_std**2), (p.runs, 1, 1))
        process = np.diag(p.process_std**2)
        means, log_likelihood = np.empty((p.rows, n, p.runs)), np.zeros(p.runs)
        for k in range(p.rows):
            if k:
                points = p.transition(draw(m, cov).transpose(1, 0, 2), p.torque[k - 1]).transpose(1, 0, 2)
                m = points @ mean_weight
                deviation = points - m[:, :, None]
                cov = (deviation * cov_weight) @ deviation.transpose(0, 2, 1) + process
            points = draw(m, cov)
            expected = points[:, 0] @ mean_weight
            deviation = (points[:, 0] - expected[:, None]) * cov_weight
            variance = np.sum(deviation * (points[:, 0] - expected[:, None]), axis=1) + p.speed_std**2
            cross = np.sum((points - m[:, :, None]) * deviation[:, None], axis=2)
            innovation = p.speed[k] - expected
            m = m + cross * (innovation / variance)[:, None]
            cov = cov - cross[:, :, None] * cross[:, None, :] / variance[:, None, None]
            log_likelihood -= 0.5 * (innovation**2 / variance + np.log(2 * np.pi * variance))
            means[k] = m.T
        return Result(means, log_likelihood)

    return run
