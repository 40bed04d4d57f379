"""The ground under a car's wheels: a road in the car's axes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_finite, check_kind, real_array, word_for
from jaxveh.roads.base import AbstractRoad


class Ground(NamedTuple):
    """The ground under a car's wheels, in the car's axes.

    - `friction_fl`, `friction_fr`, `friction_rl`, `friction_rr` (-): friction under the front left, front right, rear left
      and rear right wheel, over that of the road on which the tyres' parameters hold.
    - `grade` (rad): positive uphill in the direction in which the car points.
    - `bank` (rad): positive where the car's left side is higher.
    - `height_fl`, `height_fr`, `height_rl`, `height_rr` (m): height of the road's unevenness under each wheel. Models without
      sprung wheels ignore it.
    """

    friction_fl: Any = 1.0
    friction_fr: Any = 1.0
    friction_rl: Any = 1.0
    friction_rr: Any = 1.0
    grade: Any = 0.0
    bank: Any = 0.0
    height_fl: Any = 0.0
    height_fr: Any = 0.0
    height_rl: Any = 0.0
    height_rr: Any = 0.0


LEVEL = Ground()
"""A level road with the friction of the road on which the tyres' parameters hold."""


def under(road: AbstractRoad, x: Any, y: Any, yaw: Any, wheels: Sequence[tuple[Any, Any]]) -> Ground:
    """The ground under a car at the world's `x`, `y` (m) with the heading `yaw` (rad, to the left of the road's direction).

    `wheels`: the wheels' positions (forward, left) relative to the centre of gravity in m, in the order front left, front
    right, rear left, rear right. Friction and height are those under each wheel, slopes those under the centre of gravity:

        tan(grade_car) =  tan(grade) cos(yaw) + tan(bank) sin(yaw)
        tan(bank_car)  = -tan(grade) sin(yaw) + tan(bank) cos(yaw)

    Elementwise in x, y and yaw. **Raises** `InputError` unless there are a road, four wheels, and numbers of
    shapes that go together.
    """
    check_kind("road", road, AbstractRoad, "Such as roads.Level().")
    x, y, yaw = (real_array(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw)))
    try:
        np.broadcast_shapes(x.shape, y.shape, yaw.shape)
    except ValueError:
        raise InputError(f"x, y, yaw have shapes {x.shape}, {y.shape}, {yaw.shape}: must go together.") from None
    cosine, sine = numerics.cos(yaw), numerics.sin(yaw)
    stands = [
        road.at(x + forward * cosine - left * sine, y + forward * sine + left * cosine)
        for forward, left in _places(wheels)
    ]
    here = road.at(x, y)
    along, across = numerics.tan(here.grade), numerics.tan(here.bank)
    grade = numerics.arctan(along * cosine + across * sine)
    bank = numerics.arctan(across * cosine - along * sine)
    friction, height = [at.friction for at in stands], [at.height for at in stands]
    return Ground(*jnp.broadcast_arrays(*friction, grade, bank, *height))


def _places(wheels: Any) -> list[tuple[Any, Any]]:
    """The four positions, each (forward, left)."""
    try:
        places = [tuple(place) for place in wheels]
    except TypeError:
        places = []
    if len(places) != 4 or any(len(place) != 2 for place in places):
        shown = f"{len(places)} positions" if places else word_for(wheels)
        raise InputError(
            f"wheels: {shown}; there must be 4 (front left, front right, rear left, ...), each (forward, left) in m."
        )
    for value in itertools.chain(*places):
        check_finite("wheels", value)
    return places
