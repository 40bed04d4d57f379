"""A road that takes its friction, slopes and unevenness from different roads."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh._core.errors import InputError, word_for
from jaxveh.roads.base import AbstractRoad, Surface


class Combined(AbstractRoad):
    """A road with the `friction` of one road, the `grade` of another, the `bank` of a third and the `height` of a fourth.

    Where `bank` or `height` is None, the road of `grade` gives it.

    **Raises** `InputError` for a part that is not a road.
    """

    friction: AbstractRoad
    grade: AbstractRoad
    bank: AbstractRoad | None = None
    height: AbstractRoad | None = None

    def __check_init__(self):
        for name in ("friction", "grade", "bank", "height"):
            road = getattr(self, name)
            if not isinstance(road, AbstractRoad) and not (name in ("bank", "height") and road is None):
                raise InputError(f"Combined.{name} = {word_for(road)}: must be a road of jaxveh.roads.")

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        friction, shape = self.friction.at(s, y).friction, self.grade.at(s, y)
        bank = shape.bank if self.bank is None else self.bank.at(s, y).bank
        height = shape.height if self.height is None else self.height.at(s, y).height
        return Surface(*jnp.broadcast_arrays(friction, shape.grade, bank, height))
