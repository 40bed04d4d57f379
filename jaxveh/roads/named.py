"""Roads by name and from files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax

from jaxveh._core.errors import InputError, check_key, did_you_mean, word_for
from jaxveh.io import read_road
from jaxveh.roads.base import AbstractRoad
from jaxveh.roads.friction import Level, MuJump, SplitMu
from jaxveh.roads.profile import Profile
from jaxveh.roads.random_road import RandomRoad, gauss_markov
from jaxveh.roads.rough import Rough, rough
from jaxveh.roads.slopes import Banked


class NamedRoad(NamedTuple):
    """A road by name. `make`: the function that makes it; `help`: its description; `random`: whether `make` takes a key."""

    make: Callable[..., AbstractRoad]
    help: str
    random: bool = False


def _hills(key: jax.Array | None = None) -> RandomRoad:
    return RandomRoad(grade=gauss_markov(0.03, 150.0, jax.random.key(0) if key is None else key))


def _uneven(key: jax.Array | None = None) -> Rough:
    return rough("C", jax.random.key(0) if key is None else key)


ROADS: dict[str, NamedRoad] = {
    "level": NamedRoad(Level, "level, with the friction on which the tyres were measured"),
    "wet": NamedRoad(lambda: Level(0.7), "level, 0.7 of that friction"),
    "ice": NamedRoad(lambda: Level(0.15), "level, 0.15 of that friction"),
    "split-mu": NamedRoad(lambda: SplitMu(1.0, 0.3), "level, 0.3 of that friction right of the centre line"),
    "mu-jump": NamedRoad(lambda: MuJump(1.0, 0.4, 50.0), "level, 0.4 of that friction from 50 m on"),
    "hills": NamedRoad(_hills, "random grade: standard deviation 3 %, correlation length 150 m", random=True),
    "uneven": NamedRoad(_uneven, "level but uneven: class C of ISO 8608; acts on sprung cars only", random=True),
    "banked": NamedRoad(lambda: Banked(0.05), "bank rises to 0.05 rad (left side higher) within 50 m"),
}
"""Roads by name. Their numbers are our own choice and of usual size."""


def from_specification(spec: Any) -> AbstractRoad:
    """A road from the content of its file: `spec` is a `jaxveh.io.RoadSpecification`, or anything with its fields.

    **Raises** `InputError` for what lacks one of them.
    """
    lacking = [name for name in ("distance", "friction", "grade", "bank", "interpolation") if not hasattr(spec, name)]
    if lacking:
        raise InputError(
            f"spec = {word_for(spec)}: has no {', '.join(lacking)}; must be a jaxveh.io.RoadSpecification (io.read_road)."
        )
    distance = (0.0, 1.0) if spec.distance is None else spec.distance
    table = lambda value: jax.numpy.asarray(value, float)
    return Profile(
        table(distance), table(spec.friction), table(spec.grade), table(spec.bank), interpolation=spec.interpolation
    )


def named_road(name: str | os.PathLike, key: jax.Array | None = None) -> AbstractRoad:
    """A road by its name in `ROADS`, or from a file ending in .toml (`jaxveh.io.road.ROAD_SCHEMA`).

    `key` draws a random road ("hills", "uneven"; default `jax.random.key(0)`).

    **Raises** `InputError` for an unknown name (it lists the known ones), or a file that does not describe a road.
    """
    if key is not None:
        check_key("named_road", key)
    if str(name) in ROADS:
        road = ROADS[str(name)]
        return road.make(key) if road.random else road.make()
    if isinstance(name, str | os.PathLike) and Path(name).suffix.lower() == ".toml":
        return from_specification(read_road(name))
    guess = did_you_mean([str(name)], ROADS)
    raise InputError(f"road = {str(name)!r}: must be one of {', '.join(ROADS)}, or a file that ends in .toml.{guess}")
