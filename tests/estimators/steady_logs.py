"""Logs of motions whose right answer is known: a circle on a banked road, a straight climb, a car that is pushed."""

import numpy as np
from method_logs import CAR

from jaxveh import Recording
from jaxveh.vehicles import GRAVITY

G = float(GRAVITY)
LENGTH = CAR.front_axle_to_cg + CAR.rear_axle_to_cg
UNDERSTEER = CAR.mass / LENGTH * (
    CAR.rear_axle_to_cg / CAR.front_cornering_stiffness - CAR.front_axle_to_cg / CAR.rear_cornering_stiffness
)  # fmt: skip
WHEELS = tuple(f"wheel_speed_{at}" for at in ("fl", "fr", "rl", "rr"))


def log(needs, channels, rows, step=0.01):
    """A recording of these channels; those that a method needs and nobody names are silent."""
    full = lambda value: np.broadcast_to(np.asarray(value, float), (rows,)).copy()
    made = {need.channel: full(channels.get(need.channel, np.nan)) for need in needs}
    return Recording(step * np.arange(rows), made, {need.channel: need.unit for need in needs})


def banked_circle(needs, *, speed=20.0, yaw_rate=0.1, bank=0.04, a_y_offset=0.0, rows=1500):
    """A steady circle (yaw_rate may be (rows,), slow against everything) on a road of one bank, without noise.

    Its sine of angles is taken as the angle: what the methods say may differ by a third of a per cent.
    """
    f_y = speed * yaw_rate + G * np.sin(bank)
    body_roll = CAR.roll_gradient * f_y
    curve = LENGTH * yaw_rate / speed
    time = 0.01 * np.arange(rows)
    slip = CAR.mass * CAR.front_axle_to_cg / (LENGTH * CAR.rear_cornering_stiffness) * f_y
    course = yaw_rate * (time - 0.14) + CAR.rear_axle_to_cg * yaw_rate / speed - slip
    return log(
        needs,
        {
            "a_y": f_y + G * body_roll + a_y_offset, "yaw_rate": yaw_rate, "a_x": 0.0, "roll_rate": 0.0, "pitch_rate": 0.0,
            **dict.fromkeys(WHEELS, speed), "steering_wheel": CAR.steering_ratio * (curve + UNDERSTEER * f_y),
            "course": np.where(np.arange(rows) % 20 == 0, (course + np.pi) % (2.0 * np.pi) - np.pi, np.nan),
        },
        rows,
    ), bank + body_roll  # fmt: skip


def pushed(needs, *, mass=1500.0, grade=0.03, offset=0.0, swing=1.5, speed=20.0, rows=4000, seed=0, brakes=True):
    """A car on a straight climb whose pedals move (`swing`, m/s^2); noise of the accelerometer and of the wheels' speed."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(rows)
    rate = swing * np.sin(0.8 * time)
    v_x = speed + swing / 0.8 * (1.0 - np.cos(0.8 * time))
    turning = 4.0 * CAR.wheel_inertia / CAR.wheel_radius**2
    force = (mass + turning) * rate + CAR.drag * v_x**2 + CAR.rolling_resistance * mass * G + mass * G * np.sin(grade)
    felt = rate + G * np.sin(grade)
    torque = force * CAR.wheel_radius
    noise = lambda std: std * rng.normal(size=rows)
    satellite = np.where(np.arange(rows) % 20 == 0, np.interp(time - 0.14, time, v_x) + noise(0.05), np.nan)
    climb = np.interp(time - 0.14, time, v_x) * np.sin(grade) + noise(0.1)
    return log(
        needs,
        {
            "a_x": felt * (1.0 + G * CAR.pitch_gradient) + offset + noise(0.05), "a_y": 0.0, "yaw_rate": 0.0,
            **{name: v_x + noise(0.02) for name in WHEELS}, "speed": satellite,
            "climb_rate": np.where(np.isnan(satellite), np.nan, climb),
            "drive_torque": np.maximum(torque, 0.0) if brakes else torque, "brake_torque": np.maximum(-torque, 0.0) * brakes,
        },
        rows,
    )  # fmt: skip
