"""The drives: a slalom of a car of seven degrees of freedom, and sensors whose noise differs from their data sheet."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import manoeuvres, numerics, roads, vehicles
from jaxveh._core.recording import Recording
from jaxveh.experiments.model_adaptive_pf.settings import Case, Study
from jaxveh.simulation import simulate
from jaxveh.statespace import RolledRK4
from jaxveh.tyres import AbstractTyre, FialaPolynomial, Relaxed
from jaxveh.vehicles import QuasiStatic, SevenDOF, TwoTrack3DOF, sets

START = 1.0
"""s of straight running before the slalom."""


HARMONICS = 20
"""Number of harmonics of the slopes."""

WHEELS = ("fl", "fr", "rl", "rr")
"""The order of the rims."""


class Drive(NamedTuple):
    """The channels that filters may use, (T,) each, and the truth.

    `steer` (rad), `drive_torque`, `brake_torque` (N m) are exact; `v_x` (m/s), `a_y` (m/s^2), `yaw_rate` (rad/s) are
    measured; `level`: the noise's level over the data sheet's; `true_v_x`, `true_v_y` (m/s), `true_yaw_rate`, `true_a_y`,
    `true_sideslip` (rad), `true_a_x` (m/s^2). `rims` (m/s, (T, 4)): each wheel's spin times its radius as measured, and
    `true_rims`; NaN if the truth has no wheel spins.
    """

    steer: Any
    drive_torque: Any
    brake_torque: Any
    v_x: Any
    a_y: Any
    yaw_rate: Any
    level: Any
    true_v_x: Any
    true_v_y: Any
    true_yaw_rate: Any
    true_a_y: Any
    true_sideslip: Any
    true_a_x: Any
    rims: Any
    true_rims: Any


def times(study: Study) -> jax.Array:
    """The times of the rows, s."""
    return jnp.asarray(np.arange(round(study.duration / study.dt) + 1) * study.dt)


def numbers_of(study: Study) -> vehicles.CarNumbers:
    """The numbers of the paper's car, whose four tyres are equal."""
    tyre = sets.TyreNumbers(study.cornering_stiffness, slip_stiffness=study.slip_stiffness, friction=study.friction)
    return vehicles.CarNumbers(
        name="the car of Qin et al.", source="Qin et al. 2014, Table 1; wheels' inertia, air and rolling are ours",
        front_axle_to_cg=study.front_axle_to_cg, rear_axle_to_cg=study.rear_axle_to_cg, mass=study.mass,
        yaw_inertia=study.yaw_inertia, front=tyre, rear=tyre, cg_height=study.cg_height, track_front=study.track_front,
        track_rear=study.track_rear, wheel_radius=study.wheel_radius, wheel_inertia=study.wheel_inertia, drag=study.drag,
        rolling_resistance=study.rolling_resistance,
    )  # fmt: skip


def true_car(study: Study) -> SevenDOF:
    """Seven degrees of freedom, on typical MF-Tyres of the printed stiffness and friction with their own relaxation lengths."""
    numbers = numbers_of(study)
    front, rear = (
        Relaxed(sets.wheel_tyre(tyre, load, study.wheel_radius))
        for tyre, load in zip((numbers.front, numbers.rear), numbers.wheel_loads(), strict=True)
    )
    return vehicles.build(numbers, SevenDOF, front=front, rear=rear)


def fiala(study: Study, tyre=1.0, **changes) -> AbstractTyre:
    """The paper's Fiala tyre with its errata corrected, `tyre` times as stiff and as strong."""
    numbers = {
        "slip_stiffness": study.slip_stiffness,
        "cornering_stiffness": tyre * study.cornering_stiffness,
        "friction": tyre * study.friction,
        "trail": study.trail,
    }
    return FialaPolynomial(**(numbers | changes))


def spinning_car(study: Study, tyre: AbstractTyre) -> SevenDOF:
    """The paper's own car as a filter's model: seven degrees of freedom on these tyres."""
    return vehicles.build(numbers_of(study), SevenDOF, front=tyre, rear=tyre, load_transfer=QuasiStatic())


def model_car(study: Study, tyre: AbstractTyre) -> TwoTrack3DOF:
    """The car of the filters' models: the same car on these tyres, with spins and load transfer that follow without delay."""
    return vehicles.build(
        numbers_of(study), TwoTrack3DOF, front=tyre, rear=tyre, load_transfer=QuasiStatic(), grip=study.friction
    )


def drive_once(study: Study, case: Case, key) -> Drive:
    """One drive of a case; a pure function, for `vmap`. Cases of one key differ only in their settings."""
    driver_key, sensor_key, road_key = jax.random.split(key, 3)
    speed, steer = jax.random.normal(driver_key, (2,))
    manoeuvre = manoeuvres.slalom(
        study.speed * case.speed * (1.0 + study.speed_spread * speed),
        case.steer * (math.pi / 180.0) * (1.0 + study.steer_spread * steer),
        frequency=study.frequency, periods=study.periods, start=START, duration=study.duration,
    )  # fmt: skip
    found = simulate(
        true_car(study), manoeuvre, None, road=road_of(study, case, road_key), dt=study.dt, max_step=study.max_step,
        start={"v_x": manoeuvre.speed}, throw=False, solver=RolledRK4(),
    )  # fmt: skip
    truth = {name: found[f"true.{name}"] for name in ("v_x", "v_y", "yaw_rate", "a_y", "sideslip", "a_x")}
    rims = _rims(study, found)
    rattle = jax.random.normal(jax.random.fold_in(sensor_key, 1), rims.shape)
    noise, level = noise_of(study, case, sensor_key)
    return Drive(
        **{name: found[name] for name in ("steer", "drive_torque", "brake_torque")},
        **{name: truth[name] + noise[name] for name in study.stds},
        level=level,
        rims=rims + study.rim * level[:, None] * rattle,
        true_rims=rims,
        **{f"true_{name}": value for name, value in truth.items()},
    )


def _rims(study: Study, found: Recording) -> jax.Array:
    """Speeds of the wheels' rims (T, 4), m/s."""
    names = [f"true.omega_{at}" for at in WHEELS]
    if names[0] not in found.names:
        return jnp.full((len(found), len(WHEELS)), jnp.nan)
    return study.wheel_radius * jnp.stack([found[name] for name in names], axis=-1)


def road_of(study: Study, case: Case, key) -> roads.RandomRoad:
    """A road whose bank and grade no filter is told."""
    # A level road is so nearly level that no filter notices: a standard deviation of zero is not allowed.
    std = study.slope * jnp.maximum(case.slope, 1e-6)
    make = lambda k: roads.gauss_markov(std, study.slope_length, k, count=HARMONICS)
    bank_key, grade_key = jax.random.split(key)
    return roads.RandomRoad(grade=make(grade_key), bank=make(bank_key), friction=case.friction)


def noise_of(study: Study, case: Case, key) -> tuple[dict[str, jax.Array], jax.Array]:
    """The noise of each channel, (T,), and its level."""
    phase_key, plain_key, wild_key, choice_key = jax.random.split(key, 4)
    t = times(study)
    phase = math.pi * jax.random.uniform(phase_key)
    level = 1.0 + (case.level - 1.0) * numerics.sin(math.pi / study.level_period * t + phase) ** 2
    shape = (len(study.stds), *t.shape)
    plain, wild = (jax.random.normal(k, shape) for k in (plain_key, wild_key))
    is_wild = jax.random.uniform(choice_key, shape) < case.outliers
    total = level * plain + jnp.where(is_wild, study.outlier_size * wild, 0.0)
    return {name: std * total[i] for i, (name, std) in enumerate(study.stds.items())}, level
