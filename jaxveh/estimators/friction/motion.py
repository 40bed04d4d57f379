"""The car's motion from a log, the first stage of every lateral method: values held between measurements, and their ages."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh.estimators.rear_steer import rear_angle
from jaxveh.estimators.two_axles import LONGEST, LOWEST


class Told(NamedTuple):
    """The last row: its time `t` (s), `v_x` (m/s, never below `LOWEST`), `steer` (rad) with the delay of the inertial sensors,
    `a_x` (m/s^2), the ages (s) of speed, steer and inertial sensors, and whether the car `moves`: speed, steer and inertial
    sensors have recent measurements, and the speed is at least `LOWEST`. `raw_v_x` and `raw_steer` are the last measurements;
    `steer_rear` (rad) is the angle of steered rear wheels."""

    t: Any
    v_x: Any
    steer: Any
    a_x: Any
    raw_v_x: Any
    raw_steer: Any
    speed_age: Any
    steer_age: Any
    inertial_age: Any
    moves: Any
    steer_rear: Any


def start_told(t, values, late) -> Told:
    """The motion after the first row; `late` as in `next_told`."""
    zero, old = jnp.zeros_like(t), jnp.full_like(t, 1e3)
    start = Told(t, zero + LOWEST, zero, zero, zero, zero, old, old, old, jnp.asarray(False), zero)
    return next_told(start, t, values, late)


def next_told(last: Told, t, values, late) -> Told:
    """The motion after the next row. `late` (s): the delay of the inertial sensors against the steering angle sensor, their
    low-pass filter included."""
    dt = jnp.clip(t - last.t, 0.0, 1.0)
    v_x, speed_age = _held(values["v_x"], last.raw_v_x, last.speed_age, dt)
    raw_steer, steer_age = _held(values["steer"], last.raw_steer, last.steer_age, dt)
    a_x, _ = _held(values.get("a_x", jnp.full_like(t, jnp.nan)), last.a_x, last.speed_age, dt)
    silent = jnp.isnan(values["yaw_rate"]) | jnp.isnan(values["a_y"])
    inertial_age = jnp.where(silent, last.inertial_age + dt, 0.0)
    fresh = (speed_age <= LONGEST) & (steer_age <= LONGEST) & (inertial_age <= LONGEST)
    delayed = last.steer + (raw_steer - last.steer) * (1.0 - jnp.exp(-dt / late))
    steer = jnp.where(last.steer_age > LONGEST, raw_steer, delayed)
    moves = fresh & (v_x >= LOWEST)
    at_least, rear = jnp.maximum(v_x, LOWEST), rear_angle(values, jnp.zeros_like(t))
    return Told(t, at_least, steer, a_x, v_x, raw_steer, speed_age, steer_age, inertial_age, moves, rear)


def _held(value, last, age, dt):
    here = ~jnp.isnan(value)
    return jnp.where(here, value, last), jnp.where(here, 0.0, age + dt)
