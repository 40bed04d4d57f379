"""The problems of the Gaussian filters as plain arrays and functions of vectors, the form for other libraries."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .linear_problem import LinearTrack, linear_track
from .peers import jax_models
from .problems import SingleTrack, SpeedAndMass, single_track, speed_and_mass

__all__ = ["Plain", "linear", "speed", "track"]


class Plain(NamedTuple):
    """A state-space model without names, in NumPy arrays of one precision, with the measurements of every run.

    ``transition(x, u) -> x`` and ``observation(x, u) -> y`` are functions of JAX vectors (n,) and (k,), ``moved`` and
    ``seen`` the same in NumPy. Row t of ``inputs`` (rows, k) has the inputs of the step into row t and of its measurement.
    ``mean`` (n,), ``covariance`` and ``process`` (n, n), ``noise`` (m, m), ``measured`` (runs, rows, m). ``matrices``:
    F (n, n), B (n, k), H (m, n), D (m, k) of a linear model, otherwise None. ``problem`` is the original problem.
    """

    transition: Callable
    observation: Callable
    moved: Callable
    seen: Callable
    mean: np.ndarray
    covariance: np.ndarray
    process: np.ndarray
    noise: np.ndarray
    inputs: np.ndarray
    measured: np.ndarray
    matrices: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None
    problem: Any


def linear(rows: int, runs: int = 1, dtype: type = np.float64) -> Plain:
    """Return the linear single track, with four states and two sensors."""
    p = linear_track(rows, runs, dtype=dtype)
    F, b, H, d = p.matrices
    nothing = np.zeros_like
    B, D = np.stack([b, nothing(b)], axis=1), np.stack([nothing(d), d], axis=1)
    move = lambda x, u: F @ x + B @ u
    see = lambda x, u: H @ x + D @ u
    inputs = np.stack([_before(p.steer), p.steer], axis=1)
    measured = np.stack([p.yaw_rate, p.lateral_acceleration], axis=-1).transpose(1, 0, 2)
    return Plain(move, see, move, see, *_spreads(p, p.measured_std), inputs, measured, (F, B, H, D), p)


def speed(rows: int, runs: int = 1, dtype: type = np.float64) -> Plain:
    """Return the problem of speed, mass and grade, with three states and one sensor."""
    p = speed_and_mass(rows, runs, dtype=dtype)
    transition, observation = jax_models.speed_functions(p)
    moved = lambda x, u: p.transition(x, u[0])
    inputs, noise = _before(p.torque)[:, None], np.array([p.speed_std], dtype)
    spreads = _spreads(p, noise)
    return Plain(transition, observation, moved, lambda x, u: x[:1], *spreads, inputs, p.speed.T[:, :, None], None, p)


def track(rows: int, runs: int = 1, dtype: type = np.float64) -> Plain:
    """Return the single track with eight tyre coefficients, with eleven states and two sensors."""
    problems = [single_track(rows, seed, dtype) for seed in range(runs)]
    p = problems[0]
    functions = jax_models.single_track_functions(p)

    def seen(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        front, rear = p.axle_forces(x, u[2], u[3])
        return np.stack([x[2], (front + rear) / p.mass])

    inputs = np.stack([_before(p.steer), _before(p.speed), p.steer, p.speed], axis=1)
    measured = np.stack([np.stack([q.yaw_rate, q.lateral_acceleration], axis=-1) for q in problems])
    noise = np.array([p.yaw_rate_std, p.lateral_acceleration_std], dtype)
    return Plain(
        lambda x, u: functions.transition(x, u[0], u[1]),
        lambda x, u: functions.observation(x, u[2], u[3]),
        lambda x, u: p.transition(x, u[0], u[1]),
        seen,
        *_spreads(p, noise),
        inputs,
        measured,
        None,
        p,
    )


def _before(values: np.ndarray) -> np.ndarray:
    """Return the values of the previous row; the first row keeps its own."""
    return np.concatenate([values[:1], values[:-1]])


def _spreads(p: LinearTrack | SpeedAndMass | SingleTrack, noise: np.ndarray) -> tuple[np.ndarray, ...]:
    return p.prior_mean, np.diag(p.prior_std**2), np.diag(p.process_std**2), np.diag(noise**2)
