"""The problems as functions of plain arrays in `jax.numpy`, the form for other JAX libraries."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..problems import SingleTrack, SpeedAndMass

__all__ = ["TrackFunctions", "gaussian_arrays", "over_runs", "single_track_functions", "speed_functions"]


def speed_functions(problem: SpeedAndMass) -> tuple[Callable, Callable]:
    """Return the transition (3,), (1,) -> (3,), with the torque at the step's start as input, and the observation -> (1,)."""
    p = problem

    def transition(x: jax.Array, u: jax.Array) -> jax.Array:
        v, mass, grade = x
        constant = u[0] / (p.wheel_radius * mass)
        constant = constant - p.gravity * (p.rolling_resistance * jnp.cos(grade) + jnp.sin(grade))
        drag = p.drag / mass

        def slope(v: jax.Array) -> jax.Array:
            return constant - drag * v * v

        h = p.step
        k1 = slope(v)
        k2 = slope(v + h / 2 * k1)
        k3 = slope(v + h / 2 * k2)
        k4 = slope(v + h * k3)
        return jnp.stack([v + h / 6 * (k1 + 2 * (k2 + k3) + k4), mass, grade])

    def observation(x: jax.Array, u: jax.Array) -> jax.Array:
        return x[:1]

    return transition, observation


def over_runs(one: Callable) -> Callable:
    """Return a jitted function of the measurements (rows, m) of one run, or of many (runs, rows, m)."""
    return jax.jit(lambda measured, *rest: (one if measured.ndim == 2 else jax.vmap(one))(measured, *rest))


def gaussian_arrays(problem: SpeedAndMass, dtype: np.typing.DTypeLike) -> dict[str, jax.Array]:
    """Return mean, covariances and the torque of the step into each row, as arrays of ``dtype``."""
    p = problem
    into = np.concatenate([p.torque[:1], p.torque[:-1]])[:, None]
    return {
        "mean": jnp.asarray(p.prior_mean, dtype),
        "covariance": jnp.diag(jnp.asarray(p.prior_std, dtype) ** 2),
        "process": jnp.diag(jnp.asarray(p.process_std, dtype) ** 2),
        "measurement": jnp.asarray([[p.speed_std**2]], dtype),
        "inputs": jnp.asarray(into, dtype),
    }


class TrackFunctions(NamedTuple):
    """``transition(x, steer, speed)`` (11,) without noise, ``observation(x, steer, speed)`` (2,): yaw rate and a_y, and
    ``log_likelihood(y, x, steer, speed)`` of a measurement."""

    transition: Callable
    observation: Callable
    log_likelihood: Callable


def single_track_functions(problem: SingleTrack) -> TrackFunctions:
    """Return the eleven-state problem as functions of one particle (11,)."""
    p = problem

    def magic_formula(slip, D, C, B, E):
        x = B * slip
        return D * jnp.sin(C * jnp.arctan(x - E * (x - jnp.arctan(x))))

    def forces(x, v_y, r, steer, speed):
        front = steer - jnp.arctan((v_y + p.front * r) / speed)
        rear = -jnp.arctan((v_y - p.rear * r) / speed)
        return magic_formula(front, *x[3:7]) * jnp.cos(steer), magic_formula(rear, *x[7:11])

    def transition(x, steer, speed):
        def slope(v_y, r):
            front, rear = forces(x, v_y, r, steer, speed)
            moment = (p.front * front - p.rear * rear) / p.inertia
            return jnp.stack([(front + rear) / p.mass - speed * r, r, moment])

        h = p.step
        k1 = slope(x[0], x[2])
        k2 = slope(x[0] + h / 2 * k1[0], x[2] + h / 2 * k1[2])
        k3 = slope(x[0] + h / 2 * k2[0], x[2] + h / 2 * k2[2])
        k4 = slope(x[0] + h * k3[0], x[2] + h * k3[2])
        return jnp.concatenate([x[:3] + h / 6 * (k1 + 2 * (k2 + k3) + k4), x[3:]])

    constant = float(np.log(2 * np.pi * p.yaw_rate_std * p.lateral_acceleration_std))

    def observation(x, steer, speed):
        front, rear = forces(x, x[0], x[2], steer, speed)
        return jnp.stack([x[2], (front + rear) / p.mass])

    def log_likelihood(y, x, steer, speed):
        yaw_rate, acceleration = observation(x, steer, speed)
        r = (yaw_rate - y[0]) / p.yaw_rate_std
        a = (acceleration - y[1]) / p.lateral_acceleration_std
        return -0.5 * (r * r + a * a) - constant

    return TrackFunctions(transition, observation, log_likelihood)
