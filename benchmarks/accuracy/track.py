"""Test-track drives: every manoeuvre of the package that turns, on its own, with the cars, sensors and car files of the fleet.

They are short, and say little: a ramp of steer or a slalom has one frequency. An estimate that calibrates itself on them must not
be led astray.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import Recording, manoeuvres, roads, vehicles

from .fleet import DT, SHORTEST_WAVE, WAVES, Run, Told, cars, draw_biases, draw_file, shift_steer, simulate_runs
from .logs import Log

STRAIGHT = {"mu-jump-braking": "it goes straight ahead", "cruise": "it goes straight ahead"}
"""Manoeuvres without any sideslip."""

FRICTION, ROUGHNESS, BANK = (0.75, 1.0), (4e-6, 32e-6), 0.015
"""Range of the track's friction and unevenness (m^3), and standard deviation of its bank (rad) in every other drive."""

SPUN, SLOWEST = np.radians(60.0), 4.0
"""Sideslip (rad) from which on, and speed (m/s) up to which, a car is not driven any more: its log ends. Below 3 m/s the steps
of the simulation are too long for the wheels' spins, and accelerations are wrong by several m/s^2."""

LEAST = 5.5
"""Shortest log, s."""


class Course(NamedTuple):
    """How a manoeuvre is driven: its `name` in `MANOEUVRES`, `speed` (m/s), steer as that of a steady turn that uses this `share`
    of the grip (-), and its `options`."""

    name: str
    speed: float
    share: float = 0.0
    options: Mapping[str, Any] = MappingProxyType({})


COURSES = {
    "double lane change": Course("double-lane-change", 22.0, 0.65, {"start": 4.0, "duration": 14.0}),
    "step": Course("step-steer", 28.0, 0.4, {"start": 4.0, "duration": 14.0}),
    "step beyond the limit": Course("step-steer", 22.0, 1.8, {"start": 4.0, "duration": 12.0}),
    "swept sine": Course("swept-sine", 25.0, 0.3, {"duration": 25.0}),
    "sine with dwell": Course("sine-with-dwell", 22.0, 1.3, {"start": 4.0, "duration": 12.0}),
    "ramp": Course("ramp-steer", 22.0, 1.2, {"start": 3.0}),
    "slow slalom": Course("slalom", 8.3, 0.35, {"frequency": 0.2, "periods": 6.0, "start": 3.0}),
    "slalom": Course("slalom", 19.4, 0.5, {"frequency": 0.5, "periods": 10.0, "start": 3.0}),
    "random steering": Course("random-steering", 22.0, 0.15, {"duration": 60.0}),
    "braking in a turn": Course("braking-in-a-turn", 22.0, 0.4),
    "lane change between cones": Course("iso-lane-change", 19.4),
    "obstacle avoidance": Course("iso-obstacle-avoidance", 13.9),
    "slalom between cones": Course("slalom-course", 12.5),
    "circle": Course("steady-circle", 15.0),
}
"""Every manoeuvre that turns, by a name of its own."""


def track(course: str, runs: int, seed: int = 0) -> Iterator[Log]:
    """Yield the logs of `runs` drives of one of the `COURSES`, with every car in turn, simulated by one program.

    A drive ends when its car has `SPUN` or is slower than `SLOWEST`, and is left out if that is sooner than `LEAST`.
    """
    rng, numbers = np.random.default_rng([seed, list(COURSES).index(course)]), cars()
    names = [list(numbers)[i % len(numbers)] for i in range(runs)]
    drawn = [_draw(numbers[car], COURSES[course], i, rng) for i, car in enumerate(names)]
    stacked = jax.tree.map(
        lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *[one.run for one in drawn]
    )
    said, truth = (jax.tree.map(np.asarray, one) for one in simulate_runs(stacked))
    for i, (car, one) in enumerate(zip(names, drawn, strict=True)):
        channels = shift_steer({channel: values[i] for channel, values in said.items()}, rng)
        # The reference is the truth at the centre of gravity of the car file.
        v_y = truth["v_y"][i] + one.told.cg_error * truth["yaw_rate"][i]
        recording = Recording(DT * np.arange(len(v_y)), {**channels, "v_y": v_y}, source=f"{course} {i}")
        driven = (np.abs(np.arctan2(v_y, channels["v_x"])) < SPUN) & (channels["v_x"] > SLOWEST)
        kept = recording.rows(slice(0, len(recording) if driven.all() else int(np.argmin(driven))))
        if len(kept) * DT >= LEAST:
            yield Log(f"{course} {i}: {car}", one.told.file, kept)


class _Drawn(NamedTuple):
    run: Run
    told: Told


def _draw(numbers: vehicles.CarNumbers, course: Course, i: int, rng: np.random.Generator) -> _Drawn:
    friction, roughness = rng.uniform(*FRICTION), float(np.exp(rng.uniform(*np.log(ROUGHNESS))))
    uneven, bank, steering, own = jax.random.split(jax.random.key(int(rng.integers(2**31))), 4)
    shape = roads.RandomRoad(bank=roads.gauss_markov(BANK if i % 2 else 1e-9, 60.0, bank), friction=friction)
    road = roads.Combined(shape, shape, height=roads.rough(roughness, uneven, shortest=SHORTEST_WAVE, count=WAVES))
    steer = _steer(numbers, course.speed, course.share * friction * _grip(numbers) * vehicles.GRAVITY)
    driver = manoeuvres.named_manoeuvre(course.name, course.speed, steer, steering, **course.options)
    car = vehicles.build(numbers, vehicles.FourteenDOF)
    return _Drawn(Run(car, road, driver, draw_biases(rng), own), draw_file(numbers, rng, roughness))


def _grip(numbers: vehicles.CarNumbers) -> float:
    return min(numbers.front.friction, numbers.rear.friction)


def _steer(numbers: vehicles.CarNumbers, speed: float, a_y: float) -> float:
    """The steer (rad) of a steady turn of `a_y` with linear tyres, not below that of a neutral car."""
    a, length = numbers.front_axle_to_cg, numbers.wheelbase
    front, rear = 2 * numbers.front.cornering_stiffness, 2 * numbers.rear.cornering_stiffness
    understeer = numbers.mass / length * ((length - a) / front - a / rear)
    return a_y * (length / speed**2 + max(understeer, 0.0))
