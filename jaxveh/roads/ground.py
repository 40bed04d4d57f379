"""What the wheels of one car stand on at one instant."""

from __future__ import annotations

from typing import Any, NamedTuple


class Ground(NamedTuple):
    """The road under a car, in the car's own directions.

    - `friction_fl`, `friction_fr`, `friction_rl`, `friction_rr` (-): under each wheel, over that of the road on which the
      tyres' parameters hold.
    - `grade` (rad): uphill, in the direction in which the car points, is positive.
    - `bank` (rad): positive where the car's left side is higher. The tangents of both are the slopes of the road's plane.
    """

    friction_fl: Any = 1.0
    friction_fr: Any = 1.0
    friction_rl: Any = 1.0
    friction_rr: Any = 1.0
    grade: Any = 0.0
    bank: Any = 0.0


LEVEL = Ground()
"""A level road of the friction at which the tyres were measured."""
