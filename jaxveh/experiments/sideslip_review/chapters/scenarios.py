"""The drives of the chapters, each ordinary except for one thing."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp


class Scenario(NamedTuple):
    """One drive's numbers.

    - `steer` (rad): standard deviation at the road wheels. `wander` (m/s): standard deviation of the wanted speed.
    - `friction`, `friction_later` (-): of the road, in its first half and after it. `split` (-): by which share it is less under
      the right wheels; the border runs under the middle of the car.
    - `bank`, `grade` (rad): standard deviations along the way.
    - `drop` (m/s): by how much the driver slows down within 2 s, half way; `wheelspin` (m/s): by how much faster instead.
    - `offsets`, `spread` (-): offsets of the inertial sensors, and errors of the car's file, as multiples of the ordinary ones.
    - `stiffness`, `load` (-): factor of the true tyres' stiffness, and added share of the body's mass.
    - `outage` (s): how long the satellites have no measurements, from a third of the drive on.
    """

    steer: float = 0.012
    wander: float = 2.0
    friction: float = 1.0
    friction_later: float = 1.0
    split: float = 0.0
    bank: float = 0.005
    grade: float = 0.01
    drop: float = 0.0
    wheelspin: float = 0.0
    offsets: float = 1.0
    spread: float = 1.0
    stiffness: float = 1.0
    load: float = 0.0
    outage: float = 0.0


SCENARIOS = {
    "normal": Scenario(),
    "limit": Scenario(steer=0.022),
    "low mu": Scenario(friction=0.35, friction_later=0.35),
    "mu jump": Scenario(steer=0.016, friction_later=0.4),
    "split mu": Scenario(steer=0.02, split=0.6, drop=8.0),
    "bank": Scenario(bank=0.05),
    "grade": Scenario(grade=0.06),
    "ABS": Scenario(friction=0.35, friction_later=0.35, steer=0.006, drop=14.0),
    "wheelspin": Scenario(friction=0.4, friction_later=0.4, steer=0.002, wheelspin=2.5),
    "sensor bias": Scenario(offsets=5.0),
    "satellite outage": Scenario(outage=20.0),
    "wrong stiffness": Scenario(stiffness=0.65),
    "heavy load": Scenario(load=0.3),
}
"""Drives by name. For a long run the end of the first is compared with its beginning."""


def scenario_at(index) -> Scenario:
    """The scenario of an index that may be traced: its numbers are looked up."""
    every = list(SCENARIOS.values())
    look = lambda name: jnp.asarray([float(getattr(one, name)) for one in every])[jnp.asarray(index).astype(jnp.int32)]
    return Scenario(**{name: look(name) for name in Scenario._fields})
