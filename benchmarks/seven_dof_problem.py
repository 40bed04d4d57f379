"""Drives of the car with seven degrees of freedom: the problem that every contestant simulates."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["Drives", "drives"]

STATES = ("v_x", "v_y", "yaw", "yaw_rate", "omega_fl", "omega_fr", "omega_rl", "omega_rr")


@dataclass(frozen=True)
class Drives:
    """A sine steer with a constant torque on all wheels, for cars that differ in speed, mass and tyres.

    Arrays are (runs,). States are saved after every `steps_a_row` steps of `step` s. `amplitude` (rad at the road wheels),
    `frequency` (Hz), `drive_torque` (N m, of all wheels together). Tyres: F = `friction` load sin(C arctan(B s - ...)).
    """

    speed: np.ndarray
    mass: np.ndarray
    stiffness_front: np.ndarray
    friction_front: np.ndarray
    stiffness_rear: np.ndarray
    friction_rear: np.ndarray
    rows: int
    steps_a_row: int = 10
    step: float = 1e-3
    amplitude: float = 0.03
    frequency: float = 0.5
    drive_torque: float = 400.0
    front_drive: float = 0.4
    shape: float = 1.5
    curvature: float = 0.2
    body: dict[str, float] = field(
        default_factory=lambda: {
            "yaw_inertia": 2500.0,
            "front_axle_to_cg": 1.2,
            "rear_axle_to_cg": 1.4,
            "track_front": 1.52,
            "track_rear": 1.48,
            "cg_height": 0.5,
            "wheel_radius": 0.3,
            "wheel_inertia": 1.0,
            "drag": 0.4,
            "rolling_resistance": 0.01,
        }
    )

    @property
    def runs(self) -> int:
        """Number of cars."""
        return len(self.speed)

    @property
    def steps(self) -> int:
        """Steps of one run."""
        return self.rows * self.steps_a_row

    def steer(self, t: np.ndarray) -> np.ndarray:
        """Return the steer angle, rad, at times in s."""
        return self.amplitude * np.sin(2 * np.pi * self.frequency * t)


def drives(runs: int, rows: int, seed: int = 0) -> Drives:
    """Return drives of cars of 1300 to 1700 kg at 15 to 30 m/s on tyres that differ by a tenth."""
    rng = np.random.default_rng(seed)
    between = lambda low, high: rng.uniform(low, high, runs)
    return Drives(
        speed=between(15.0, 30.0),
        mass=between(1300.0, 1700.0),
        stiffness_front=between(9.0, 11.0),
        friction_front=between(0.85, 1.0),
        stiffness_rear=between(11.0, 13.0),
        friction_rear=between(0.9, 1.05),
        rows=rows,
    )
