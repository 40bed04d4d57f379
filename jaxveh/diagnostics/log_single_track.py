"""The linear single track in NumPy, the reference for checks of a log of a known car."""

from __future__ import annotations

import numpy as np

from jaxveh.io import CarSpecification

SLOW = 3.0
"""Speed below which the lateral motion is held at zero, m/s."""


def yaw_rate_from_steer(
    car: CarSpecification, steer: np.ndarray, rear: np.ndarray, v_x: np.ndarray, step: float
) -> np.ndarray:
    """Return the yaw rate (N,) in rad/s of the linear single track for the angles of front and rear wheels, `steer` and `rear`
    (N,) in rad, at v_x (N,) in m/s, every `step` s.

    Implicit Euler is stable at every speed. NaN inputs give NaN rows, and the motion starts again from zero after them.
    """
    m, I_z, a, b = car.mass, car.yaw_inertia, car.front_axle_to_cg, car.rear_axle_to_cg
    C_f, C_r = float(car.front_cornering_stiffness or 0), float(car.rear_cornering_stiffness or 0)
    yaw_rate = np.full(steer.shape, np.nan)
    v_y = r = 0.0
    for k, (angle, behind, speed) in enumerate(zip(steer.tolist(), rear.tolist(), v_x.tolist(), strict=True)):
        if not (np.isfinite(angle + behind) and speed > SLOW):
            v_y = r = 0.0
            continue
        # (1 - h A) x+ = x + h B (steer, rear), with x = (v_y, r).
        h = step
        A_11, A_12 = 1 + h * (C_f + C_r) / (m * speed), h * ((a * C_f - b * C_r) / (m * speed) + speed)
        A_21, A_22 = h * (a * C_f - b * C_r) / (I_z * speed), 1 + h * (a * a * C_f + b * b * C_r) / (I_z * speed)
        F_f, F_r = C_f * angle, C_r * behind
        right_1, right_2 = v_y + h * (F_f + F_r) / m, r + h * (a * F_f - b * F_r) / I_z
        det = A_11 * A_22 - A_12 * A_21
        v_y, r = (right_1 * A_22 - A_12 * right_2) / det, (A_11 * right_2 - A_21 * right_1) / det
        yaw_rate[k] = r
    return yaw_rate


def a_y_from_yaw_rate(
    car: CarSpecification, yaw_rate: np.ndarray, rear: np.ndarray, v_x: np.ndarray, step: float
) -> np.ndarray:
    """Return the lateral acceleration (N,) in m/s^2 that belongs to a yaw rate (N,) in rad/s and an angle `rear` (N,) of the rear
    wheels in rad if the rear axle is linear.

    The rear axle carries (a m a_y - I_z dr/dt) / L, which gives its slip angle and thus v_y = b r + v_x rear - v_x K w, with the
    softness K = a m / (L C_r) and w = a_y - I_z / (a m) dr/dt. With a_y = v_x r + dv_y/dt, w follows v_x r + (b - I_z / (a m))
    dr/dt + d(v_x rear)/dt with a lag of v_x K seconds (implicit Euler, stable at every speed). Inputs must be finite.
    """
    lag = np.maximum(v_x * rear_softness(car), 0.0)
    turning, inertia = np.gradient(yaw_rate, step), car.yaw_inertia / (car.front_axle_to_cg * car.mass)
    wanted = v_x * yaw_rate + (car.rear_axle_to_cg - inertia) * turning + np.gradient(v_x * rear, step)
    followed = np.empty_like(wanted)
    value = wanted[0]
    for k, (target, share) in enumerate(zip(wanted.tolist(), (step / (step + lag)).tolist(), strict=True)):
        value = value + share * (target - value)
        followed[k] = value
    return followed + inertia * turning


def steady_v_y(car: CarSpecification, yaw_rate: np.ndarray, rear: np.ndarray, v_x: np.ndarray) -> np.ndarray:
    """Return v_y (N,) in m/s in a steady turn of the linear single track with this yaw rate (N,) in rad/s and angle `rear` (N,)
    of the rear wheels in rad."""
    return (car.rear_axle_to_cg - rear_softness(car) * v_x * np.abs(v_x)) * yaw_rate + v_x * rear


def rear_softness(car: CarSpecification) -> float:
    """Return the rear axle's slip angle over the lateral acceleration of a steady turn, rad/(m/s^2)."""
    return car.mass * car.front_axle_to_cg / (car.wheelbase * float(car.rear_cornering_stiffness or np.inf))


def understeer_gradient(car: CarSpecification) -> float:
    """Return the steer at the road wheels beyond the geometric part per lateral acceleration, rad per m/s^2."""
    a, b, C_f, C_r = (
        car.front_axle_to_cg,
        car.rear_axle_to_cg,
        float(car.front_cornering_stiffness or 0),
        float(car.rear_cornering_stiffness or 0),
    )
    return car.mass / car.wheelbase * (b / C_f - a / C_r)
