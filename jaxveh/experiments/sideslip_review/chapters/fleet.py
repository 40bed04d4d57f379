"""The cars of the chapters: the content of their files, and the true cars."""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import vehicles
from jaxveh.experiments.sideslip_review.chapters.scenarios import Scenario
from jaxveh.io import CarSpecification
from jaxveh.vehicles import AbstractDrive, AntiLock, AxleDrive, FourteenDOF

CARS = ("sedan", "van", "compact_car")
"""Measured cars of CommonRoad's vehicle models, with tyres of Magic Formula 5.2; one per seed, drawn at random."""

KNOWN = {
    "steering_ratio": 16.0, "drag": 0.4, "rolling_resistance": 0.012, "brake_torque_per_pressure": 1.6e-3, "satellite_delay":
    0.15, "inertial_delay": 0.01,
}  # fmt: skip
"""Numbers of the cars in addition to the measured ones, by the keys of a car's file."""

STEERING_RATIO = KNOWN["steering_ratio"]

SPREADS = {"stiffness": 0.1, "grip": 0.05, "mass": 0.04, "yaw_inertia": 0.05, "place": 0.03}
"""How much a true car differs from its file (standard deviations, relative; `place` in m): as in the race of observers."""


def told_cars(names: tuple[str, ...] = CARS) -> list[CarSpecification]:
    """The files, each of a car as built, without draws."""
    named = lambda name: vehicles.specification_of(vehicles.kit.CARS[name]())
    return [dataclasses.replace(named(name), **KNOWN) for name in names]


def built_cars(names: tuple[str, ...] = CARS) -> FourteenDOF:
    """The cars as built, stacked: one array axis of `names` on each leaf. A car with one motor per wheel gets an engine
    here, so that the drives of all cars have the same channels."""
    where = lambda car: (car.drag, car.rolling_resistance, car.drive)
    axle = lambda car: car.drive if isinstance(car.drive, AxleDrive) else AxleDrive()
    resists = lambda car: (jnp.asarray(KNOWN["drag"]), jnp.asarray(KNOWN["rolling_resistance"]), axle(car))
    cars = [vehicles.named_car(name, "fourteen-dof") for name in names]
    built = [eqx.tree_at(where, car, resists(car), is_leaf=lambda v: isinstance(v, AbstractDrive)) for car in cars]
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *built)


def true_car(built: FourteenDOF, scenario: Scenario, key) -> AntiLock:
    """The true car: it differs from its file by draws, and has the scenario's tyres and load, and anti-lock brakes.

    Draws are lognormal: they can halve a parameter, but never make it negative. A load lies a little behind the centre of
    gravity.
    """
    draws = scenario.spread * jax.random.normal(key, (6,))
    spreads = jnp.asarray([SPREADS[name] for name in ("stiffness", "stiffness", "grip", "mass", "yaw_inertia")])
    front, rear, grip, mass, inertia = jnp.exp(draws[:5] * spreads)
    back = 0.1 * scenario.load / 0.3 - SPREADS["place"] * draws[5]
    tyre = lambda tyre, stiffness: eqx.tree_at(
        lambda t: (t.scaling.LKY, t.scaling.LMUY, t.scaling.LMUX), tyre,
        (tyre.scaling.LKY * stiffness * scenario.stiffness, tyre.scaling.LMUY * grip, tyre.scaling.LMUX * grip),
    )  # fmt: skip
    where = lambda c: (c.sprung_mass, c.yaw_inertia, c.front_axle_to_cg, c.rear_axle_to_cg, c.front, c.rear)
    heavier = 1.0 + scenario.load
    found = (
        built.sprung_mass * mass * heavier, built.yaw_inertia * inertia * (1.0 + 0.6 * scenario.load),
        built.front_axle_to_cg + back, built.rear_axle_to_cg - back, tyre(built.front, front), tyre(built.rear, rear),
    )  # fmt: skip
    return AntiLock(eqx.tree_at(where, built, found))
