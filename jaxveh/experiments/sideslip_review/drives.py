"""The drives: a car of seven degrees of freedom whose data sheet has random errors."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import manoeuvres, roads, sensors, vehicles
from jaxveh.experiments.sideslip_review.settings import SCENARIOS, Scenario, Study
from jaxveh.manoeuvres import RandomSteering
from jaxveh.simulation import simulate
from jaxveh.tyres import MagicFormula, Relaxed, Similarity
from jaxveh.vehicles import SevenDOF, sets

HARMONICS = 20
"""Number of harmonics of steering and banks."""

CHANNELS = ("yaw_rate", "a_x", "a_y")


class Drive(NamedTuple):
    """The channels that estimators may use, (T,) each: `time` (s), `steer` (rad), `v_x` (m/s), `a_x`, `a_y` (m/s^2),
    `yaw_rate` (rad/s); `fresh`: whether yaw_rate and a_y are new in this row; and the truth: `sideslip` (rad), `lateral`
    (m/s^2, the true a_y)."""

    time: Any
    steer: Any
    v_x: Any
    a_x: Any
    a_y: Any
    yaw_rate: Any
    fresh: Any
    sideslip: Any
    lateral: Any


def numbers_of() -> vehicles.CarNumbers:
    """The data sheet."""
    return sets.ev()


def scenario_at(index) -> Scenario:
    """The scenario of an index that may be traced: its numbers are looked up."""
    every = list(SCENARIOS.values())
    look = lambda name: jnp.asarray([float(getattr(one, name)) for one in every])[jnp.asarray(index).astype(jnp.int32)]
    return Scenario(**{name: look(name) for name in ("steer", "pace", "friction", "bank", "offset", "spread")})


def true_car(study: Study, spread, key) -> SevenDOF:
    """The true car: that of the data sheet, with each parameter off by a draw of `spread` times the study's."""
    draws = spread * jax.random.normal(key, (6,))
    # Lognormal: a draw can halve a parameter, but never makes it negative.
    front, rear, grip, mass, inertia = jnp.exp(
        draws[:5] * jnp.asarray([study.stiffness, study.stiffness, study.grip, study.mass, study.yaw_inertia])
    )
    place = study.place * draws[5]
    sheet = vehicles.build(numbers_of(), SevenDOF)
    tyres = (_tyre(study, 0, front, grip), _tyre(study, 1, rear, grip))
    where = lambda c: (c.mass, c.yaw_inertia, c.front_axle_to_cg, c.rear_axle_to_cg, c.front, c.rear)
    found = (
        sheet.mass * mass, sheet.yaw_inertia * inertia, sheet.front_axle_to_cg + place, sheet.rear_axle_to_cg - place,
        *tyres,
    )  # fmt: skip
    return eqx.tree_at(where, sheet, found)


def _tyre(study: Study, axle: int, stiffness, grip) -> Relaxed:
    """The tyre of one wheel of an axle (0: front): a Magic Formula for all loads, roads and directions."""
    numbers = numbers_of()
    load, known = numbers.wheel_loads()[axle], 0.5 * numbers.values()[("front_stiffness", "rear_stiffness")[axle]]
    D = study.peak_friction * load * grip
    curve = MagicFormula(B=known * stiffness / (study.C * D), C=study.C, D=D, E=study.E)
    return Relaxed(Similarity(curve, load, study.stiffest * load, study.slip_stiffness), sigma_y=study.relaxation)


def steering(study: Study, scenario: Scenario, key) -> RandomSteering:
    """Random steering at a constant speed."""
    drawn = manoeuvres.random_steering(
        study.speed,
        0.01,
        key,
        lowest=study.lowest,
        highest=study.highest,
        count=HARMONICS,
        duration=study.duration,
    )
    where = lambda m: (m.steer, m.frequencies)
    return eqx.tree_at(where, drawn, (scenario.steer, scenario.pace * drawn.frequencies))


def road_of(study: Study, scenario: Scenario, key) -> roads.Combined:
    """A road whose friction changes half way, with random banks."""
    half = 0.5 * study.speed * study.duration
    drawn = roads.gauss_markov(1.0, study.bank_length, key, shortest=study.bank_length / 3, count=HARMONICS)
    bank = eqx.tree_at(lambda b: b.std, drawn, scenario.bank)
    friction = roads.MuJump(before=1.0, after=scenario.friction, at_distance=half)
    return roads.Combined(friction=friction, grade=roads.RandomRoad(bank=bank))


def drive_once(study: Study, scenario: Scenario, key) -> Drive:
    """One drive; a pure function, for `vmap`."""
    car_key, steer_key, road_key, sensor_key = jax.random.split(key, 4)
    found = simulate(
        true_car(study, scenario.spread, car_key), steering(study, scenario, steer_key), None,
        road=road_of(study, scenario, road_key), dt=study.dt, max_step=study.max_step,
        start={"v_x": study.speed}, throw=False,
    )  # fmt: skip
    return _measure(study, scenario, found, sensor_key)


def _measure(study: Study, scenario: Scenario, found, key) -> Drive:
    offsets_key, inertial_key, speed_key = jax.random.split(key, 3)
    draws = jax.random.normal(offsets_key, (4,))
    spreads = {"yaw_rate": study.yaw_rate_offset, "a_x": study.a_offset, "a_y": study.a_offset}
    offsets = {name: scenario.offset * spreads[name] * draws[i] for i, name in enumerate(CHANNELS)}
    signals = {name: sensors.Signal(noise=getattr(study, name), bias=offsets[name]) for name in CHANNELS}
    unit = sensors.IMU(signals, rate=1.0 / study.dt)
    time = jnp.asarray(found.time)
    truth = {name: found[f"true.{name}"] for name in (*unit.needs, "v_x", "sideslip", "steer")}
    said = unit.say(time, truth, inertial_key)
    speed = sensors.Signal(noise=study.v_x).apply(truth["v_x"], study.dt, speed_key)
    return Drive(
        time=time,
        steer=truth["steer"] + study.steer_offset * draws[3],
        v_x=speed,
        **said,
        fresh=jnp.ones_like(speed, bool),
        sideslip=truth["sideslip"],
        lateral=truth["a_y"],
    )
