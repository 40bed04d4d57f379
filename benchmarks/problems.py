"""The two problems that every contestant solves, in NumPy and SI units, with simulated measurements.

A single track with Magic Formula axles, eight of whose coefficients are estimated, and a vehicle on a grade whose mass is
estimated. Noise is discrete: standard deviations are those of one step.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["SingleTrack", "SpeedAndMass", "single_track", "speed_and_mass"]


def _array(*values: float) -> np.ndarray:
    return np.array(values, np.float64)


@dataclass(frozen=True)
class SingleTrack:
    """Eleven states at a given speed; yaw rate and lateral acceleration are measured.

    The states are lateral velocity (m/s), yaw (rad), yaw rate (rad/s), then D (N), C, B, E of the front and of the rear
    axle. ``steer`` (rad at the road wheels), ``speed`` (m/s), ``yaw_rate`` (rad/s) and ``lateral_acceleration`` (m/s^2) are
    ``(rows,)``; the standard deviations of prior and process are ``(11,)``.
    """

    steer: np.ndarray
    speed: np.ndarray
    yaw_rate: np.ndarray
    lateral_acceleration: np.ndarray
    mass: float = 1420.0
    inertia: float = 2124.0
    front: float = 0.96
    rear: float = 1.59
    step: float = 0.01
    prior_mean: np.ndarray = field(
        default_factory=lambda: _array(0, 0, 0, 7872, 1.6, 6.9986, -0.0542, 5609, 1.6, 14.1636, 0.2)
    )
    prior_std: np.ndarray = field(
        default_factory=lambda: _array(5e-3, 5e-5, 2.5e-3, 100, 1e-2, 0.1, 1e-2, 100, 1e-2, 0.1, 1e-2)
    )
    process_std: np.ndarray = field(
        default_factory=lambda: _array(1e-3, 1e-5, 5e-4, 20, 2e-3, 2e-2, 2e-3, 20, 2e-3, 2e-2, 2e-3)
    )
    yaw_rate_std: float = 0.01
    lateral_acceleration_std: float = 0.2

    @property
    def rows(self) -> int:
        """Number of measurements."""
        return len(self.steer)

    def axle_forces(self, x: np.ndarray, steer: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the lateral forces of front axle (along the car's y) and rear axle, (N,) each, from states (11, N)."""
        front = steer - np.arctan((x[0] + self.front * x[2]) / speed)
        rear = -np.arctan((x[0] - self.rear * x[2]) / speed)
        return _magic_formula(front, *x[3:7]) * np.cos(steer), _magic_formula(rear, *x[7:11])

    def transition(self, x: np.ndarray, steer: float, speed: float) -> np.ndarray:
        """Return the states after one Runge-Kutta step without noise, (11, N) to (11, N)."""

        def slope(v_y: np.ndarray, r: np.ndarray) -> np.ndarray:
            front, rear = self.axle_forces(np.stack([v_y, x[1], r, *x[3:]]), steer, speed)
            return np.stack(
                [
                    (front + rear) / self.mass - speed * r,
                    r,
                    (self.front * front - self.rear * rear) / self.inertia,
                ]
            )

        h = self.step
        k1 = slope(x[0], x[2])
        k2 = slope(x[0] + h / 2 * k1[0], x[2] + h / 2 * k1[2])
        k3 = slope(x[0] + h / 2 * k2[0], x[2] + h / 2 * k2[2])
        k4 = slope(x[0] + h * k3[0], x[2] + h * k3[2])
        return np.concatenate([x[:3] + h / 6 * (k1 + 2 * (k2 + k3) + k4), x[3:]])

    def log_likelihood(self, x: np.ndarray, row: int) -> np.ndarray:
        """Return log p(y_row | x), (N,), from states (11, N)."""
        front, rear = self.axle_forces(x, self.steer[row], self.speed[row])
        r = (x[2] - self.yaw_rate[row]) / self.yaw_rate_std
        a = ((front + rear) / self.mass - self.lateral_acceleration[row]) / self.lateral_acceleration_std
        return -0.5 * (r * r + a * a) - np.log(2 * np.pi * self.yaw_rate_std * self.lateral_acceleration_std)


def _magic_formula(slip: np.ndarray, D: np.ndarray, C: np.ndarray, B: np.ndarray, E: np.ndarray) -> np.ndarray:
    x = B * slip
    return D * np.sin(C * np.arctan(x - E * (x - np.arctan(x))))


def single_track(rows: int, seed: int = 0, dtype: type = np.float64) -> SingleTrack:
    """Return a weave of two frequencies at 25 m/s, simulated from the prior's mean with measurement noise.

    The arrays are of ``dtype``; the problem's numbers are rounded to it.
    """
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(rows)
    steer = 0.03 * np.sin(2 * np.pi * 0.5 * t) + 0.015 * np.sin(2 * np.pi * 1.3 * t)
    empty = SingleTrack(steer, np.full(rows, 25.0), np.zeros(rows), np.zeros(rows))
    x = empty.prior_mean[:, None]
    yaw_rate, acceleration = np.zeros(rows), np.zeros(rows)
    for k in range(rows):
        if k:
            x = empty.transition(x, steer[k - 1], 25.0)
        front, rear = empty.axle_forces(x, steer[k], 25.0)
        yaw_rate[k] = x[2, 0] + empty.yaw_rate_std * rng.standard_normal()
        acceleration[k] = (front + rear)[0] / empty.mass + empty.lateral_acceleration_std * rng.standard_normal()
    rounded = [a.astype(dtype) for a in (steer, empty.speed, yaw_rate, acceleration)]
    noises = {name: getattr(empty, name).astype(dtype) for name in ("prior_mean", "prior_std", "process_std")}
    return SingleTrack(*rounded, **noises)


@dataclass(frozen=True)
class SpeedAndMass:
    """Speed (m/s), mass (kg) and road grade (rad) from a measured speed, for one run or many.

    ``torque`` (N m at the wheels) is ``(rows,)`` and the same in every run, ``speed`` (m/s) is ``(rows, runs)``.
    ``alpha``, ``beta`` and ``kappa`` are those of the scaled unscented transform.
    """

    torque: np.ndarray
    speed: np.ndarray
    wheel_radius: float = 0.3
    gravity: float = 9.81
    rolling_resistance: float = 0.01
    drag: float = 0.36
    step: float = 0.01
    prior_mean: np.ndarray = field(default_factory=lambda: _array(10, 1500, 0))
    prior_std: np.ndarray = field(default_factory=lambda: _array(0.3, 100, 1e-2))
    process_std: np.ndarray = field(default_factory=lambda: _array(1e-2, 0.3, 1e-5))
    speed_std: float = 0.1
    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0

    @property
    def rows(self) -> int:
        """Number of measurements."""
        return self.speed.shape[0]

    @property
    def runs(self) -> int:
        """Number of independent runs."""
        return self.speed.shape[1]

    def transition(self, x: np.ndarray, torque: float) -> np.ndarray:
        """Return the states after one Runge-Kutta step without noise, (3, N) to (3, N); ``drag`` is rho c_d A / 2 (kg/m)."""
        v, mass, grade = x
        pull = torque / (self.wheel_radius * mass)
        slope_force = self.gravity * (self.rolling_resistance * np.cos(grade) + np.sin(grade))

        def slope(v: np.ndarray) -> np.ndarray:
            return pull - slope_force - self.drag * v * v / mass

        h = self.step
        k1 = slope(v)
        k2 = slope(v + h / 2 * k1)
        k3 = slope(v + h / 2 * k2)
        k4 = slope(v + h * k3)
        return np.stack([v + h / 6 * (k1 + 2 * (k2 + k3) + k4), mass, grade])


def speed_and_mass(
    rows: int, runs: int = 1, seed: int = 0, dtype: type = np.float64, beta: float = 2.0
) -> SpeedAndMass:
    """Return a drive with a slowly varying torque, simulated from the prior's mean; every run has its own measurement noise.

    With ``beta = 0`` the centre point of the unscented transform has no weight at all (a cubature filter).
    """
    rng = np.random.default_rng(seed)
    torque = 600 + 300 * np.sin(0.01 * np.arange(rows))
    empty = SpeedAndMass(torque, np.zeros((rows, 1)))
    x = empty.prior_mean[:, None]
    truth = np.zeros(rows)
    for k in range(rows):
        x = empty.transition(x, torque[k - 1]) if k else x
        truth[k] = x[0, 0]
    speed = truth[:, None] + empty.speed_std * rng.standard_normal((rows, runs))
    noises = {name: getattr(empty, name).astype(dtype) for name in ("prior_mean", "prior_std", "process_std")}
    return SpeedAndMass(torque.astype(dtype), speed.astype(dtype), beta=beta, **noises)
