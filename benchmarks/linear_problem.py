"""A linear problem for exact filters: the motion of a single track with linear tyres, and two sensors that drift."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["LinearTrack", "linear_track"]


def _array(*values: float) -> np.ndarray:
    return np.array(values, np.float64)


@dataclass(frozen=True)
class LinearTrack:
    """Four states at a constant speed; yaw rate and lateral acceleration are measured, each with its own slow error.

    The states are lateral velocity (m/s), yaw rate (rad/s), then the errors of the yaw rate's (rad/s) and of the
    acceleration's sensor (m/s^2). ``steer`` (rad at the road wheels) is ``(rows,)`` and the same in every run, ``yaw_rate``
    (rad/s) and ``lateral_acceleration`` (m/s^2) are ``(rows, runs)``. Standard deviations are those of one step.

        x_k+1 = F x_k + B steer_k + noise,    y_k = H x_k + D steer_k + noise
    """

    steer: np.ndarray
    yaw_rate: np.ndarray
    lateral_acceleration: np.ndarray
    speed: float = 25.0
    mass: float = 1420.0
    inertia: float = 2124.0
    front: float = 0.96
    rear: float = 1.59
    front_stiffness: float = 88000.0
    rear_stiffness: float = 127000.0
    step: float = 0.01
    prior_mean: np.ndarray = field(default_factory=lambda: _array(0, 0, 0, 0))
    prior_std: np.ndarray = field(default_factory=lambda: _array(0.05, 0.02, 0.01, 0.1))
    process_std: np.ndarray = field(default_factory=lambda: _array(5e-3, 1e-3, 1e-4, 1e-3))
    measured_std: np.ndarray = field(default_factory=lambda: _array(0.01, 0.2))

    @property
    def rows(self) -> int:
        """Number of measurements."""
        return self.yaw_rate.shape[0]

    @property
    def runs(self) -> int:
        """Number of independent runs."""
        return self.yaw_rate.shape[1]

    @property
    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return F (4, 4), B (4,), H (2, 4), D (2,): the exponential series of the motion to fourth order, as in Runge-Kutta."""
        A, b, h_row, d = self._continuous()
        h, power, F, G = self.step, np.eye(2), np.eye(2), np.eye(2)
        for k in range(1, 5):
            power = power @ A * h / k
            F = F + power
            if k < 4:
                G = G + power / (k + 1)
        dtype = self.prior_mean.dtype
        whole = np.eye(4)
        whole[:2, :2] = F
        B = np.concatenate([h * G @ b, np.zeros(2)])
        H = np.array([[0, 1, 1, 0], [*h_row, 0, 1]])
        return whole.astype(dtype), B.astype(dtype), H.astype(dtype), np.array([0.0, d], dtype)

    def _continuous(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Return A, b of d/dt (v_y, r) = A (v_y, r) + b steer, and row and d of the acceleration, row (v_y, r) + d steer."""
        c_f, c_r, l_f, l_r, v = self.front_stiffness, self.rear_stiffness, self.front, self.rear, self.speed
        m, inertia = self.mass, self.inertia
        acceleration = np.array([-(c_f + c_r) / (m * v), -(c_f * l_f - c_r * l_r) / (m * v)])
        turning = np.array([-(c_f * l_f - c_r * l_r), -(c_f * l_f**2 + c_r * l_r**2)]) / (inertia * v)
        A = np.stack([acceleration - np.array([0.0, v]), turning])
        return A, np.array([c_f / m, c_f * l_f / inertia]), acceleration, c_f / m


def linear_track(rows: int, runs: int = 1, seed: int = 0, dtype: type = np.float64) -> LinearTrack:
    """Return a weave of two frequencies, simulated from the prior's mean; every run has its own noises.

    The arrays are of ``dtype``; the problem's numbers are rounded to it.
    """
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(rows)
    steer = 0.02 * np.sin(2 * np.pi * 0.5 * t) + 0.01 * np.sin(2 * np.pi * 1.3 * t)
    empty = LinearTrack(steer, np.zeros((rows, runs)), np.zeros((rows, runs)))
    F, B, H, D = empty.matrices
    x = empty.prior_std[:, None] * rng.standard_normal((4, runs))
    measured = np.zeros((rows, 2, runs))
    for k in range(rows):
        if k:
            x = F @ x + B[:, None] * steer[k - 1] + empty.process_std[:, None] * rng.standard_normal((4, runs))
        measured[k] = H @ x + D[:, None] * steer[k] + empty.measured_std[:, None] * rng.standard_normal((2, runs))
    noises = {name: getattr(empty, name).astype(dtype) for name in ("prior_mean", "prior_std", "process_std")}
    noises["measured_std"] = empty.measured_std.astype(dtype)
    return LinearTrack(steer.astype(dtype), measured[:, 0].astype(dtype), measured[:, 1].astype(dtype), **noises)
