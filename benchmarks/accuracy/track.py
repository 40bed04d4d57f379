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

from .fleet import DT, SHORTEST_WAVE, WAVES, Run, biases, cars, delayed, simulated, told
from .logs import Log

STRAIGHT = {"mu-jump-braking": "it goes straight ahead", "cruise": "it goes straight ahead"}
"""Manoeuvres without any sideslip."""

FRICTION, ROUGHNESS, BANK = (0.75, 1.0), (4e-6, 32e-6), 0.015
"""Range of the track's friction and unevenness (m^3), and standard deviation of its bank (rad) in every other drive."""

SPUN = np.radians(60.0)
"""Sideslip at which a log ends, rad."""

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


class TrackLog(NamedTuple):
    """A `Log` of the track, and hidden values: the course, the car's name, the road's friction."""

    log: Log
    course: str
    car: str
    friction: float


def track(runs: int, seed: int = 0, only: str = "") -> Iterator[TrackLog]:
    """Yield the logs of `runs` drives of each course whose name contains `only`, with every car in turn; each course is simulated
    by one program.

    A drive ends when its car has `SPUN` or stands, and is left out if that is sooner than `LEAST`.
    """
    for place, name in enumerate(COURSES):
        if only in name:
            yield from _course(name, runs, np.random.default_rng([seed, place]))


def _course(name: str, runs: int, rng: np.random.Generator) -> Iterator[TrackLog]:
    numbers = cars()
    names = [list(numbers)[i % len(numbers)] for i in range(runs)]
    drawn = [_draw(numbers[car], COURSES[name], i, rng) for i, car in enumerate(names)]
    stacked = jax.tree.map(
        lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *[one.run for one in drawn]
    )
    said, truth = (jax.tree.map(np.asarray, one) for one in simulated(stacked))
    for i, (car, one) in enumerate(zip(names, drawn, strict=True)):
        channels = delayed({channel: values[i] for channel, values in said.items()}, rng)
        v_y = truth["v_y"][i] + one.file.cg_error * truth["yaw_rate"][i]
        recording = Recording(DT * np.arange(len(v_y)), {**channels, "v_y": v_y}, source=f"{name} {i}")
        spun = np.flatnonzero((np.abs(np.arctan2(v_y, channels["v_x"])) > SPUN) | (channels["v_x"] < 2.0))
        kept = recording.rows(slice(0, spun[0] if spun.size else len(recording)))
        if len(kept) * DT >= LEAST:
            yield TrackLog(Log(f"{name} {i}: {car}", one.file.file, kept), name, car, one.friction)


class _Drawn(NamedTuple):
    run: Run
    file: Any
    friction: float


def _draw(numbers: vehicles.CarNumbers, course: Course, i: int, rng: np.random.Generator) -> _Drawn:
    friction, roughness = rng.uniform(*FRICTION), float(np.exp(rng.uniform(*np.log(ROUGHNESS))))
    uneven, bank, steering, own = jax.random.split(jax.random.key(int(rng.integers(2**31))), 4)
    shape = roads.RandomRoad(bank=roads.gauss_markov(BANK if i % 2 else 1e-9, 60.0, bank), friction=friction)
    road = roads.Combined(shape, shape, height=roads.rough(roughness, uneven, shortest=SHORTEST_WAVE, count=WAVES))
    steer = _steer(numbers, course.speed, course.share * friction * _grip(numbers) * vehicles.GRAVITY)
    driver = manoeuvres.named_manoeuvre(course.name, course.speed, steer, steering, **course.options)
    car = vehicles.build(numbers, vehicles.FourteenDOF)
    return _Drawn(Run(car, road, driver, biases(rng), own), told(numbers, rng, roughness), friction)


def _grip(numbers: vehicles.CarNumbers) -> float:
    return min(numbers.front.friction, numbers.rear.friction)


def _steer(numbers: vehicles.CarNumbers, speed: float, a_y: float) -> float:
    """The steer (rad) of a steady turn of `a_y` with linear tyres, not below that of a neutral car."""
    a, length = numbers.front_axle_to_cg, numbers.wheelbase
    front, rear = 2 * numbers.front.cornering_stiffness, 2 * numbers.rear.cornering_stiffness
    understeer = numbers.mass / length * ((length - a) / front - a / rear)
    return a_y * (length / speed**2 + max(understeer, 0.0))
