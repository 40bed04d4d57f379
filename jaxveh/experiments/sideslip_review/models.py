"""The estimators' models: the engineer's cars, and the kinematics of a point."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxveh import estimators, sensors, vehicles
from jaxveh._core.names import record_type
from jaxveh.experiments.sideslip_review.drives import Drive, numbers_of
from jaxveh.experiments.sideslip_review.handling import Handling, handling_model
from jaxveh.experiments.sideslip_review.settings import Noise
from jaxveh.statespace import Continuous, Gaussian, Heun, Prior, Propagate, Row, StateSpace
from jaxveh.vehicles import LinearSingleTrack, SingleTrack

SEEN = "seen_"
"""Prefix of the names of measurement noise."""

KinematicState = record_type("KinematicState", ("v_x", "v_y"))


class Cars(NamedTuple):
    """The cars that an engineer is told: the linear car, the one with nonlinear tyres, and the `Handling` around the
    latter."""

    linear: LinearSingleTrack
    nonlinear: SingleTrack
    handling: Handling


class Models(NamedTuple):
    """The state spaces: single tracks, the kinematics, and the `handling_model`."""

    linear: StateSpace
    nonlinear: StateSpace
    kinematic: StateSpace
    handling: StateSpace


def sheet_cars() -> Cars:
    """The cars of the data sheet: with its stiffnesses, and otherwise ordinary tyres."""
    numbers = numbers_of()
    track = vehicles.build(numbers, SingleTrack)
    loads = track.static_loads()
    stiffnesses = (numbers.values()[name] for name in ("front_stiffness", "rear_stiffness"))
    axles = [vehicles.axle_from_stiffness(one, load) for one, load in zip(stiffnesses, loads, strict=True)]
    options = dict(front=axles[0], rear=axles[1])
    nonlinear = vehicles.build(numbers, SingleTrack, **options)
    moving = vehicles.build(numbers, SingleTrack, cg_height=numbers.cg_height, **options)
    return Cars(vehicles.build(numbers, LinearSingleTrack), nonlinear, Handling(moving))


def models_of(cars: Cars, noise: Noise, start_speed: float) -> Models:
    """The state spaces of these cars with these noises."""
    return Models(
        linear=_single_track(cars.linear, dict(noise.linear)),
        nonlinear=_single_track(cars.nonlinear, dict(noise.nonlinear)),
        kinematic=_kinematic(dict(noise.kinematic), start_speed),
        handling=_handling_with_noise(cars.handling, dict(noise.handling)),
    )


def _split_noise(noise: dict[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Process and measurement noise."""
    seen = {name.removeprefix(SEEN): std for name, std in noise.items() if name.startswith(SEEN)}
    return {name: std for name, std in noise.items() if not name.startswith(SEEN)}, seen


def _single_track(car, noise: dict[str, float]) -> StateSpace:
    process, seen = _split_noise(noise)
    # At 100 Hz Heun's error is far below the noises, at half the work of a fourth-order method.
    return estimators.state_space(car, sensors.esc(**seen), process_noise=process, solver=Heun())


def _kinematic(noise: dict[str, float], start_speed: float) -> StateSpace:
    """v_x' = a_x + r v_y, v_y' = a_y - r v_x: accelerometers and gyroscope are inputs, the wheels' speed is measured."""
    process, seen = _split_noise(noise)
    return StateSpace(
        transition=Propagate(_drift, Heun()),
        observation=_speed,
        process_noise=Continuous(Gaussian(process)),
        measurement_noise=Gaussian(seen),
        prior=Prior(KinematicState(start_speed, 0.0), {"v_x": 1.0, "v_y": 0.2}),
        inputs=("a_x", "a_y", "yaw_rate"),
        input_path="linear",
    )


def _drift(system, t, x, u):
    return KinematicState(v_x=u.a_x + u.yaw_rate * x.v_y, v_y=u.a_y - u.yaw_rate * x.v_x)


def _speed(system, t, x, u):
    return record_type("Speed", ("v_x",))(x.v_x)


def _handling_with_noise(system: Handling, noise: dict[str, float]) -> StateSpace:
    process, seen = _split_noise(noise)
    made = handling_model(system)
    if not noise:
        return made
    return StateSpace(
        system=made.system, transition=made.transition_function, observation=made.observation_function,
        process_noise=Continuous(Gaussian(process)), measurement_noise=Gaussian(seen), prior=made.prior,
        inputs=made.inputs, report=made.report_function,
    )  # fmt: skip


def rows(model: StateSpace, drive: Drive) -> Row:
    """The drive as rows of this model."""
    seen = drive._asdict()
    u = record_type("Inputs", model.inputs)(*[seen[name] for name in model.inputs])
    fresh = lambda name: seen[name] if name == "v_x" else jnp.where(drive.fresh, seen[name], jnp.nan)
    y = record_type("Measurements", model.channels)(*[fresh(name) for name in model.channels])
    return Row(drive.time, u, y)
