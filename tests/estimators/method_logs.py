"""A drive made by hand, with every channel that a method of `estimators` may read, and what can be wrong with such a log.

It is a plane motion with slopes and a roll that follows the lateral acceleration: consistent to a per cent, made in no time. What
an estimate is worth is tested on simulated cars.
"""

import dataclasses

import numpy as np

from jaxveh import Recording, io

G = 9.81
CAR = io.CarSpecification(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.5, front_cornering_stiffness=1.1e5,
    rear_cornering_stiffness=1.3e5, cg_height=0.55, track_front=1.5, track_rear=1.5, steering_ratio=16.0, wheel_radius=0.32,
    wheel_inertia=1.2, drag=0.4, rolling_resistance=0.012, front_drive=1.0, front_brake=0.65,
    brake_torque_per_pressure=1.6e-3,
    roll_gradient=0.006, roll_frequency=1.6, roll_damping=0.3, pitch_gradient=0.004,
)  # fmt: skip
"""Every key that a method may ask for."""

ROWS, STEP = 300, 0.02
CORNERS = ("fl", "fr", "rl", "rr")


def motion(t, speed, rear=0.0):
    """Speed (m/s), yaw rate, steer and the slopes of the drive, by name; the rear wheels turn to and fro by `rear` (rad)."""
    v_x = speed * (1.0 + 0.15 * np.sin(0.9 * t))
    steer = 0.03 * np.sin(1.7 * t) + 0.01 * np.sin(4.1 * t + 1.0)
    length = CAR.front_axle_to_cg + CAR.rear_axle_to_cg
    yaw_rate = v_x * steer / (length + 0.003 * v_x**2)
    slip = CAR.mass * CAR.front_axle_to_cg / (length * CAR.rear_cornering_stiffness)
    v_y = CAR.rear_axle_to_cg * yaw_rate - slip * v_x * np.abs(v_x) * yaw_rate
    steer_rear = rear * np.sin(0.8 * t + 0.3)
    if rear:
        v_y, steer = on_linear_axles(t, v_x, yaw_rate, steer_rear)
    return dict(
        v_x=v_x,
        v_y=v_y,
        yaw_rate=yaw_rate,
        steer=steer,
        steer_rear=steer_rear,
        grade=0.03 * np.sin(0.3 * t),
        bank=0.04 * np.sin(0.4 * t + 0.5),
    )


def on_linear_axles(t, v_x, yaw_rate, steer_rear):
    """The lateral speed (m/s) and the steer of the front wheels (rad) of a single track with the file's axles and this yaw rate:
    exact while the angles of the axles change, as the motion above is not."""
    m, a, b, length = CAR.mass, CAR.front_axle_to_cg, CAR.rear_axle_to_cg, CAR.wheelbase
    turning, fine = np.gradient(yaw_rate, t), 20
    force = lambda k, v_y: CAR.rear_cornering_stiffness * (steer_rear[k] - (v_y - b * yaw_rate[k]) / v_x[k])
    push = lambda k, v_y: (length * force(k, v_y) + CAR.yaw_inertia * turning[k]) / (a * m)
    v_y = np.empty_like(t)
    v_y[0] = b * yaw_rate[0] + v_x[0] * steer_rear[0]
    for k in range(len(t) - 1):
        now = v_y[k]
        for _ in range(fine):
            now = now + (t[k + 1] - t[k]) / fine * (push(k, now) - v_x[k] * yaw_rate[k])
        v_y[k + 1] = now
    a_y = np.gradient(v_y, t) + v_x * yaw_rate
    front = (b * m * a_y + CAR.yaw_inertia * turning) / length
    return v_y, front / CAR.front_cornering_stiffness + (v_y + a * yaw_rate) / v_x


def channels(speed=15.0, seed=0, rows=ROWS, rear=0.0):
    """Every channel by name, (T,), and the truth among them."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(rows)
    one = motion(t, speed, rear)
    rate = lambda values: np.gradient(values, t)
    v_x, v_y, yaw_rate = one["v_x"], one["v_y"], one["yaw_rate"]
    flat = rate(v_y) + v_x * yaw_rate
    roll = one["bank"] + 0.006 * flat
    yaw = np.concatenate([[0.0], np.cumsum(yaw_rate[:-1] * STEP)])
    a_x = rate(v_x) - v_y * yaw_rate + G * np.sin(one["grade"])
    force = CAR.mass * a_x + CAR.drag * v_x * np.abs(v_x) + CAR.rolling_resistance * CAR.mass * G
    if rear:
        turned = CAR.rear_axle_to_cg * one["steer"] + CAR.front_axle_to_cg * one["steer_rear"]
        force = force + CAR.mass * flat * turned / CAR.wheelbase
    torque = force * CAR.wheel_radius
    sides = dict(zip(CORNERS, (-0.75, 0.75, -0.75, 0.75), strict=True))
    wheels = {f"wheel_speed_{at}": v_x + side * yaw_rate for at, side in sides.items()}
    brake, drive = np.maximum(-torque, 0.0), np.maximum(torque, 0.0)
    shares = dict(zip(CORNERS, (0.325, 0.325, 0.175, 0.175), strict=True))
    fresh = np.arange(rows) % 5 == 0
    satellite = lambda values: np.where(fresh, values, np.nan)
    front = CAR.mass * CAR.rear_axle_to_cg / 2.7 * flat
    noise = lambda values, std: values + std * rng.normal(size=rows)
    return {
        **one, "motion_yaw_rate": one["yaw_rate"], "time": t,
        "roll": roll, "pitch": -one["grade"], "yaw": yaw, "sideslip": np.arctan2(v_y, np.abs(v_x)),
        "yaw_rate": noise(yaw_rate, 0.002), "a_x": noise(a_x, 0.05), "a_y": noise(flat + G * np.sin(roll), 0.05),
        "a_z": noise(G * np.cos(roll), 0.05), "roll_rate": noise(rate(roll), 0.002),
        "pitch_rate": noise(-rate(one["grade"]), 0.002),
        "x": satellite(np.cumsum(v_x * np.cos(yaw)) * STEP), "y": satellite(np.cumsum(v_x * np.sin(yaw)) * STEP),
        "speed": satellite(np.hypot(v_x, v_y)), "course": satellite(yaw + np.arctan2(v_y, v_x)), "heading": satellite(yaw),
        "climb_rate": satellite(v_x * np.sin(one["grade"])),
        "lane_offset": satellite(np.cumsum(v_x * np.sin(yaw) + v_y * np.cos(yaw)) * STEP), "lane_heading": satellite(yaw),
        "steering_wheel": 16.0 * one["steer"], "steering_torque": front * 0.03 / 16.0,
        "brake_pressure": brake / 40.0 * 1e5 / 4.0, "throttle": np.clip(drive / 2000.0, 0.0, 1.0),
        "drive_torque": drive, "brake_torque": brake,
        **{f"torque_{at}": torque * share for at, share in shares.items()},
        **{f"brake_torque_{at}": brake * share for at, share in shares.items()},
        **{f"drive_torque_{at}": 0.25 * drive for at in CORNERS},
        **{name: noise(values, 0.02) for name, values in wheels.items()},
        **{f"steer_{at}": one["steer" if at in ("fl", "fr") else "steer_rear"] for at in CORNERS},
        **{f"omega_{at}": wheels[f"wheel_speed_{at}"] / CAR.wheel_radius for at in CORNERS},
        **{f"load_{at}": np.full(rows, CAR.mass * G / 4.0) for at in CORNERS},
    }  # fmt: skip


def log(needs, speed=15.0, seed=0, rows=ROWS, rear=0.0):
    """The channels of `needs` in a recording; those that are optional, too."""
    made = channels(speed, seed, rows, rear)
    lacking = [need.channel for need in needs if need.channel not in made]
    assert not lacking, f"method_logs has no {lacking}: add what a method reads"
    return Recording(
        made["time"], {need.channel: made[need.channel] for need in needs}, {n.channel: n.unit for n in needs}
    )


def variants(needs):
    """Logs of one length by name: as it is, with each kind of harm that one must live through."""
    plain = log(needs)
    gaps = {}
    for k, need in enumerate(needs):
        values = np.array(plain[need.channel])
        if not need.throughout:
            values[20 + 3 * k : 60 + 3 * k] = np.nan
        gaps[need.channel] = values
    silent = {n.channel: np.where(np.arange(ROWS) < 100, plain[n.channel], np.nan) for n in needs if not n.throughout}
    never = {n.channel: np.full(ROWS, np.nan) for n in needs if not n.throughout}
    standing = log(needs, 0.0)
    return {
        "plain": plain, "another": log(needs, 22.0, 1), "gaps": plain.replace(**gaps), "falls silent": plain.replace(**silent),
        "never speaks": plain.replace(**never), "standing": standing, "reverse": log(needs, -4.0), "crawling": log(needs, 0.4),
    }  # fmt: skip


def another_car():
    """A file with other numbers in all the same keys."""
    numbers = {f.name: getattr(CAR, f.name) for f in dataclasses.fields(CAR)}
    return io.CarSpecification(**{
        name: 0.97 * value if isinstance(value, float) and name not in ("steer_offset",) else value
        for name, value in numbers.items()
    })  # fmt: skip
