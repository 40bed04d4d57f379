"""Shared parts of the cornering stiffness methods: the single track's parameters, and signals with the same low-pass filter."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.car_file import lean_of
from jaxveh.estimators.delays import unit_delay
from jaxveh.estimators.rear_steer import rear_angle
from jaxveh.estimators.two_axles import (
    LATERAL,
    LONGEST,
    LOWEST,
    AbstractAxleForces,
    AbstractLinearAxles,
    linear_axles_of,
)
from jaxveh.io import CarSpecification


class LinearCar(AbstractAxleForces, AbstractLinearAxles):
    """The parameters of a linear single track; the methods start from its stiffnesses. `steer_offset` (rad): of the channel;
    `lean` (-): by which share the measured lateral acceleration is larger because the body leans."""

    steer_offset: jax.Array = parameter("rad", scale=0.002, default=0.0)
    lean: jax.Array = parameter("-", scale=0.05, default=0.059)


def linear_car(car: CarSpecification) -> LinearCar:
    """The linear single track of a car's file."""
    numbers = {"yaw_inertia": car.yaw_inertia, "steer_offset": car.steer_offset or 0.0, "lean": lean_of(car)}
    return LinearCar(**linear_axles_of(car), **numbers)


class Signals(NamedTuple):
    """Time (s); the last measured speed (m/s), steer (rad), yaw rate (rad/s) and a_y (m/s^2), and the steer with the delay of the
    inertial sensors; the low-passed signals; the `ages` (s) of the channels, and whether the car `moves` and all of them are
    available; the angle of steered rear wheels (rad)."""

    t: Any
    v_x: Any
    raw_steer: Any
    steer: Any
    yaw_rate: Any
    a_y: Any
    slow_steer: Any
    slow_yaw_rate: Any
    slow_a_y: Any
    ages: Any
    moves: Any
    steer_rear: Any


class Followed(eqx.Module):
    """Signals held between measurements, with a low-pass filter of `lag` (s), which also gives their derivatives:
    `(x - slow) / lag`. The steer is delayed by `late` (s), the delay of the inertial sensors against it."""

    lag: jax.Array = positive("s", default=0.15)
    late: jax.Array = positive("s", default=0.025)

    def start(self, t, values) -> Signals:
        """The signals after the first row."""
        known = lambda name: jnp.where(jnp.isnan(values[name]), 0.0, values[name])
        steer, yaw_rate, a_y = known("steer"), known("yaw_rate"), known("a_y")
        old = jnp.where(jnp.stack([jnp.isnan(values[need.channel]) for need in LATERAL]), 1e3, 0.0).astype(t.dtype)
        v_x = known("v_x")
        moves = (old.max() <= LONGEST) & (v_x >= LOWEST)
        rear = rear_angle(values, jnp.zeros_like(t))
        return Signals(t, v_x, steer, steer, yaw_rate, a_y, steer, yaw_rate, a_y, old, moves, rear)

    def next(self, last: Signals, t, values) -> Signals:
        """The signals after the next row."""
        dt = jnp.clip(t - last.t, 0.0, 1.0)
        missing = jnp.stack([jnp.isnan(values[need.channel]) for need in LATERAL])
        held = lambda name, old: jnp.where(jnp.isnan(values[name]), old, values[name])
        ages = jnp.where(missing, last.ages + dt, 0.0)
        anew = jnp.max(last.ages) > LONGEST
        v_x, yaw_rate, a_y = held("v_x", last.v_x), held("yaw_rate", last.yaw_rate), held("a_y", last.a_y)
        raw = held("steer", last.raw_steer)
        # A Pade delay, the all-pass `2 / (1 + s late / 2) - 1`, with a bilinear low-pass filter.
        mid = 0.5 * (last.steer + last.raw_steer)
        mid = mid + dt / (self.late + dt) * (raw + last.raw_steer - 2.0 * mid)
        steer = jnp.where(anew, raw, 2.0 * mid - raw)
        # The bilinear low-pass filter, whose exact derivative is `(x - slow) / lag`.
        share = dt / (2.0 * self.lag + dt)
        follow = lambda slow, old, new: jnp.where(anew, new, slow + share * (new + old - 2.0 * slow))
        moves = (jnp.max(ages) <= LONGEST) & (v_x >= LOWEST)
        return Signals(
            t, v_x, raw, steer, yaw_rate, a_y, follow(last.slow_steer, last.steer, steer), follow(last.slow_yaw_rate,
            last.yaw_rate, yaw_rate),
            follow(last.slow_a_y, last.a_y, a_y), ages, moves, rear_angle(values, jnp.zeros_like(t)),
        )  # fmt: skip


def signals_of(car: CarSpecification, lag: float = 0.15) -> Followed:
    """The signals of a car with the inertial unit of its file."""
    return Followed(lag, unit_delay(car))
