"""The problems for jaxveh, written as a user would write them: names, short formulas, the public interface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxveh
from jaxveh import estimators, numerics, sensors, statespace, tyres, vehicles
from jaxveh._core.bijectors import Real

from .linear_problem import LinearTrack
from .problems import SingleTrack, SpeedAndMass

__all__ = [
    "blocked",
    "constant_parameters_model",
    "linear_model",
    "linear_recording",
    "precision",
    "single_track_model",
    "single_track_recording",
    "speed_model",
    "speed_recording",
    "vehicle_model",
]


def precision(dtype: np.typing.DTypeLike):
    """Switch x64 off for float32, as a user of float32 would."""
    return jax.enable_x64(np.dtype(dtype) == np.float64)


class Motion(NamedTuple):
    """Lateral velocity, yaw, yaw rate."""

    v_y: object
    yaw: object
    yaw_rate: object


class Car(NamedTuple):
    """Motion and the Magic Formula coefficients of both axles."""

    v_y: object
    yaw: object
    yaw_rate: object
    front_D: object
    front_C: object
    front_B: object
    front_E: object
    rear_D: object
    rear_C: object
    rear_B: object
    rear_E: object


class Chassis(eqx.Module):
    """The known numbers of the car."""

    mass: jax.Array
    inertia: jax.Array
    front: jax.Array
    rear: jax.Array


class Measured(NamedTuple):
    """Yaw rate and lateral acceleration."""

    yaw_rate: object
    a_y: object


def _magic_formula(slip, D, C, B, E):
    x = B * slip
    return D * numerics.sin(C * numerics.arctan(x - E * (x - numerics.arctan(x))))


def _forces(chassis, x, motion, u):
    front = u.steer - numerics.arctan((motion.v_y + chassis.front * motion.yaw_rate) / u.v_x)
    rear = -numerics.arctan((motion.v_y - chassis.rear * motion.yaw_rate) / u.v_x)
    force_front = _magic_formula(front, x.front_D, x.front_C, x.front_B, x.front_E) * numerics.cos(u.steer)
    return force_front, _magic_formula(rear, x.rear_D, x.rear_C, x.rear_B, x.rear_E)


def _derivatives(system, t, motion, u):
    chassis, x = system
    # Each force has two consumers; without a fence XLA computes it twice.
    front, rear = numerics.fence(_forces(chassis, x, motion, u))
    return Motion(
        (front + rear) / chassis.mass - u.v_x * motion.yaw_rate,
        motion.yaw_rate,
        (chassis.front * front - chassis.rear * rear) / chassis.inertia,
    )


_MOVE = statespace.Propagate(_derivatives)


def _transition(chassis, t0, t1, x, u):
    motion = _MOVE((chassis, x), t0, t1, Motion(x.v_y, x.yaw, x.yaw_rate), u)
    return x._replace(**motion._asdict())


def _observation(chassis, t, x, u):
    front, rear = _forces(chassis, x, Motion(x.v_y, x.yaw, x.yaw_rate), u)
    return Measured(x.yaw_rate, (front + rear) / chassis.mass)


def single_track_model(problem: SingleTrack, dtype: np.typing.DTypeLike) -> statespace.StateSpace:
    """Return the model of eleven states with noise on each; yaw rate and lateral acceleration are measured."""
    p = problem
    model = statespace.StateSpace(
        system=Chassis(*(jnp.asarray(v, dtype) for v in (p.mass, p.inertia, p.front, p.rear))),
        transition=_transition,
        observation=_observation,
        process_noise=statespace.Discrete(statespace.Gaussian(_by_name(Car, p.process_std))),
        measurement_noise={"yaw_rate": p.yaw_rate_std, "a_y": p.lateral_acceleration_std},
        prior=statespace.Prior(Car(*map(float, p.prior_mean)), _by_name(Car, p.prior_std)),
        inputs=("steer", "v_x"),
    )
    return statespace.cast(model, dtype)


def constant_parameters_model(problem: SingleTrack, dtype: np.typing.DTypeLike) -> statespace.StateSpace:
    """Return the same model with noise on the motion alone: the coefficients are constant."""
    std = dict(zip(Motion._fields, map(float, problem.process_std[:3]), strict=True))
    noise = statespace.cast(statespace.Discrete(statespace.Gaussian(std)), dtype)
    return eqx.tree_at(lambda model: model.process_noise, single_track_model(problem, dtype), noise)


def vehicle_model(problem: SingleTrack, dtype: np.typing.DTypeLike) -> statespace.StateSpace:
    """Return the same state space from the library's own vehicle, tyres and sensors.

    Its parameters have additive random walks (`Real`), as those of the other contestants. Its front slip angle is computed in the
    axes of the steered wheel, one rotation more than the paper's formula, which gives the same angle for given v_x.
    """
    p = problem
    front, rear = (tyres.MagicFormula(B=B, C=C, D=D, E=E) for D, C, B, E in p.prior_mean[3:].reshape(2, 4))
    car = vehicles.SingleTrack(
        mass=p.mass, yaw_inertia=p.inertia, front_axle_to_cg=p.front, rear_axle_to_cg=p.rear, front=front, rear=rear
    )
    model = estimators.state_space(
        car,
        sensors.SensorSet(statespace.Gaussian({"yaw_rate": p.yaw_rate_std, "a_y": p.lateral_acceleration_std})),
        estimate=lambda car: [(axle.D, axle.C, axle.B, axle.E) for axle in (car.front, car.rear)],
        prior=_relative(p, p.prior_std),
        walk=_relative(p, p.process_std / np.sqrt(p.step)),
        domain=Real(),
        process_noise=dict(zip(Motion._fields, (p.process_std[:3] / np.sqrt(p.step)).tolist(), strict=True)),
        start_spread=dict(zip(Motion._fields, p.prior_std[:3].tolist(), strict=True)),
        report=(),
    )
    return statespace.cast(model, dtype)


def _relative(problem: SingleTrack, std: np.ndarray) -> dict[str, float]:
    """Return the spreads of the coefficients in the library's form: shares of the value, and for E of its scale, which is 2."""
    names = [f"{axle}.{letter}" for axle in ("front", "rear") for letter in "DCBE"]
    values = [2.0 if name.endswith("E") else float(v) for name, v in zip(names, problem.prior_mean[3:], strict=True)]
    return {name: float(s) / v for name, s, v in zip(names, std[3:], values, strict=True)}


def single_track_recording(problem: SingleTrack) -> jaxveh.Recording:
    """Return the measurements as a recording."""
    channels = {
        "steer": problem.steer,
        "v_x": problem.speed,
        "yaw_rate": problem.yaw_rate,
        "a_y": problem.lateral_acceleration,
    }
    return jaxveh.Recording(problem.step * np.arange(problem.rows), channels)


class Vehicle(NamedTuple):
    """Speed, mass and road grade."""

    v: object
    mass: object
    grade: object


class Speed(NamedTuple):
    """The speed alone: mass and grade are constant within a step."""

    v: object


class Truck(eqx.Module):
    """The known numbers of the vehicle; drag is rho c_d A / 2."""

    wheel_radius: jax.Array
    gravity: jax.Array
    rolling_resistance: jax.Array
    drag: jax.Array


def _speed_transition(truck, t0, t1, x, u):
    pull = u.torque / (truck.wheel_radius * x.mass)
    resistance = truck.gravity * (truck.rolling_resistance * numerics.cos(x.grade) + numerics.sin(x.grade))
    drag = truck.drag / x.mass
    return x._replace(v=_MOVE_SPEED((pull - resistance, drag), t0, t1, Speed(x.v), u).v)


def _speed_derivative(system, t, x, u):
    constant, drag = system
    return Speed(constant - drag * x.v * x.v)


_MOVE_SPEED = statespace.Propagate(_speed_derivative)


def _speed_observation(truck, t, x, u):
    return Speed(x.v)


def speed_model(problem: SpeedAndMass, dtype: np.typing.DTypeLike) -> statespace.StateSpace:
    """Return the model of speed, mass and grade with noise on each; the speed is measured."""
    p = problem
    model = statespace.StateSpace(
        system=Truck(*(jnp.asarray(v, dtype) for v in (p.wheel_radius, p.gravity, p.rolling_resistance, p.drag))),
        transition=_speed_transition,
        observation=_speed_observation,
        process_noise=statespace.Discrete(statespace.Gaussian(_by_name(Vehicle, p.process_std))),
        measurement_noise={"v": p.speed_std},
        prior=statespace.Prior(Vehicle(*map(float, p.prior_mean)), _by_name(Vehicle, p.prior_std)),
        inputs=("torque",),
    )
    return statespace.cast(model, dtype)


def speed_recording(problem: SpeedAndMass, run: int = 0) -> jaxveh.Recording:
    """The measurements of one run."""
    channels = {"torque": problem.torque, "v": problem.speed[:, run]}
    return jaxveh.Recording(problem.step * np.arange(problem.rows), channels)


class Drifting(NamedTuple):
    """Lateral velocity, yaw rate, and the errors of both sensors."""

    v_y: object
    yaw_rate: object
    yaw_rate_error: object
    a_y_error: object


class Line(eqx.Module):
    """The coefficients of the motion and of the lateral acceleration: of v_y, of the yaw rate and of the steer angle."""

    v_y: tuple[jax.Array, jax.Array, jax.Array]
    yaw_rate: tuple[jax.Array, jax.Array, jax.Array]
    a_y: tuple[jax.Array, jax.Array, jax.Array]


def _along(line, x, u):
    return line[0] * x.v_y + line[1] * x.yaw_rate + line[2] * u.steer


def _linear_transition(line, t0, t1, x, u):
    return x._replace(v_y=_along(line.v_y, x, u), yaw_rate=_along(line.yaw_rate, x, u))


def _linear_observation(line, t, x, u):
    return Measured(x.yaw_rate + x.yaw_rate_error, _along(line.a_y, x, u) + x.a_y_error)


def linear_model(problem: LinearTrack, dtype: np.typing.DTypeLike) -> statespace.StateSpace:
    """Return the model of lateral motion with linear tyres, with the sensors' errors as states and noise on each."""
    p = problem
    F, B, H, D = p.matrices
    rows = (*zip(F[:2, :2], B[:2], strict=True), (H[1, :2], D[1]))
    line = Line(*(tuple(jnp.asarray(v, dtype) for v in (*row, b)) for row, b in rows))
    model = statespace.StateSpace(
        system=line,
        transition=_linear_transition,
        observation=_linear_observation,
        process_noise=statespace.Discrete(statespace.Gaussian(_by_name(Drifting, p.process_std))),
        measurement_noise=_by_name(Measured, p.measured_std),
        prior=statespace.Prior(Drifting(*map(float, p.prior_mean)), _by_name(Drifting, p.prior_std)),
        inputs=("steer",),
    )
    return statespace.cast(model, dtype)


def linear_recording(problem: LinearTrack, run: int = 0) -> jaxveh.Recording:
    """The measurements of one run."""
    channels = {
        "steer": problem.steer,
        "yaw_rate": problem.yaw_rate[:, run],
        "a_y": problem.lateral_acceleration[:, run],
    }
    return jaxveh.Recording(problem.step * np.arange(problem.rows), channels)


def _by_name(state: type, values: np.ndarray) -> dict[str, float]:
    return dict(zip(state._fields, map(float, values), strict=True))


def blocked(function: Callable[[int], object]) -> Callable[[int], object]:
    """Return the function with a wait until its arrays are computed."""
    return lambda index: jax.block_until_ready(function(index))
