"""Friction as a slow state of a single track with nonlinear tyres, from the assumption `d mu / dt = 0`."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh._core.names import record_type
from jaxveh.estimators.contract import Need
from jaxveh.estimators.friction.laws import PlanarCar
from jaxveh.estimators.method import Filtered
from jaxveh.estimators.two_axles import LOWEST
from jaxveh.filters import Unscented
from jaxveh.statespace import Continuous, Gaussian, Prior, StateSpace

READS = (
    Need("v_x", "m/s", throughout=True),
    Need("steer", "rad", throughout=True),
    Need("yaw_rate", "rad/s"),
    Need("a_y", "m/s^2"),
)
KNOWN = 0.12
"""Standard deviation of ln mu up to which the friction is known."""

USUAL, SPREAD = 0.8, 0.6
"""Prior friction, and the standard deviation of its logarithm."""


class State(NamedTuple):
    """Lateral speed (m/s), yaw rate (rad/s), ln mu (-)."""

    v_y: Any
    yaw_rate: Any
    log_friction: Any


def augmented_filter(car: PlanarCar) -> Filtered:
    """An unscented filter of [v_y, yaw rate, ln mu]; friction walks by 0.05 of itself in a second.

    Below `LOWEST` the model runs as at that speed, and nothing is known. The model has no jumps of friction, so that it follows
    one only as fast as the random walk allows. Its standard deviation assumes white noises, and leaves out errors of the tyre
    curve."""
    model = StateSpace(
        system=car, transition=_transition, observation=_observation, report=_report,
        process_noise=Continuous(Gaussian({"v_y": 0.2, "yaw_rate": 0.1, "log_friction": 0.05})),
        measurement_noise=Gaussian({"yaw_rate": 0.01, "a_y": 0.4}),
        prior=Prior(State(0.0, 0.0, float(jnp.log(USUAL))), {"v_y": 0.5, "yaw_rate": 0.2, "log_friction": SPREAD}),
        inputs=("v_x", "steer"),
    )  # fmt: skip
    return Filtered(model, Unscented(), READS, told_by=_told, shown=("friction",))


def _forces(car: PlanarCar, x, u):
    mu = jnp.exp(jnp.clip(x.log_friction, -3.0, 0.7))
    slips = car.slip_angles(u.steer, jnp.maximum(u.v_x, LOWEST), x.v_y, x.yaw_rate)
    return car.front.force(slips[0], mu), car.rear.force(slips[1], mu)


def _transition(car: PlanarCar, t0, t1, x, u):
    """A step that is linearly implicit in the tyres' damping, stable for steps up to a tenth of a second."""
    v_x = jnp.maximum(u.v_x, LOWEST)
    front, rear = _forces(car, x, u)
    stiff, a, b = car.front.stiffness + car.rear.stiffness, car.front_axle_to_cg, car.rear_axle_to_cg
    slide = stiff / (car.mass * v_x)
    turn = (a * a * car.front.stiffness + b * b * car.rear.stiffness) / (car.yaw_inertia * v_x)
    dt = jnp.clip(t1 - t0, 0.0, 1.0)
    v_y = x.v_y + dt * ((front + rear) / car.mass - v_x * x.yaw_rate) / (1.0 + 0.5 * dt * slide)
    yaw_rate = x.yaw_rate + dt * (a * front - b * rear) / car.yaw_inertia / (1.0 + 0.5 * dt * turn)
    return State(v_y, yaw_rate, x.log_friction)


def _observation(car: PlanarCar, t, x, u):
    front, rear = _forces(car, x, u)
    felt = (front + rear) / car.mass * (1.0 + car.lean)
    return record_type("Felt", ("yaw_rate", "a_y"))(x.yaw_rate, felt)


def _report(car, t, x, u):
    return record_type("FrictionReport", ("friction", "log_friction"))(jnp.exp(x.log_friction), x.log_friction)


def _told(model, belief, row):
    _, std = belief.moments(model)
    return {"friction": (std.log_friction < KNOWN) & (row.u.v_x >= LOWEST)}
