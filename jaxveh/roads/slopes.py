"""Roads with slopes: a hill and a banked road."""

from __future__ import annotations

import math
from typing import Any

import jax

from jaxveh import numerics
from jaxveh._core.errors import check
from jaxveh._core.parameter import parameter, positive
from jaxveh.numerics import smooth_bump, smooth_step
from jaxveh.roads.base import AbstractRoad, Surface, place, surface


class Hill(AbstractRoad):
    """A road that climbs by `height`, runs level over the crest and comes down again, with a continuous curvature.

    `height` (m; negative: a dip), `start` (m): where it begins, `rise`, `crest`, `fall` (m): the lengths of its parts (with
    a crest of 0 the fall follows the rise at once), `friction` (-, default 1). The elevation is a smooth step up and a smooth
    step down. The grade is steepest in the middle of each, with a slope of 1.875 height / length.

    **Raises** `InputError` for a length or a friction out of range.
    """

    height: jax.Array = parameter("m", scale=1.0)
    start: jax.Array = parameter("m", scale=10.0, default=0.0)
    rise: jax.Array = positive("m", default=100.0)
    crest: jax.Array = parameter("m", scale=10.0, default=0.0)
    fall: jax.Array = positive("m", default=100.0)
    friction: jax.Array = positive("-", default=1.0)

    def __check_init__(self):
        check("Hill.crest", self.crest, lambda v: v >= 0, "at least 0 m")

    def elevation(self, s: Any) -> jax.Array:
        """The height above the start, m, at the distance `s` (m)."""
        up, down = self._parts(s)
        return self.height * (smooth_step(up) - smooth_step(down))

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.height)
        up, down = self._parts(s)
        slope = self.height * (smooth_bump(up) / self.rise - smooth_bump(down) / self.fall)
        return surface(s, y, self.friction, grade=numerics.arctan(slope))

    def _parts(self, s):
        s, _ = place(s, 0.0, self.height)
        return (s - self.start) / self.rise, (s - self.start - self.rise - self.crest) / self.fall


class Banked(AbstractRoad):
    """A road that tilts smoothly from level to a `bank` (rad, left side higher) and keeps it.

    `start` (m, default 0): where it begins to tilt; `ramp` (m, default 50): the length of the transition; `friction` (-).

    **Raises** `InputError` for a bank beyond a quarter turn, or a ramp or friction that is not positive.
    """

    bank: jax.Array = parameter("rad", scale=0.05)
    start: jax.Array = parameter("m", scale=10.0, default=0.0)
    ramp: jax.Array = positive("m", default=50.0)
    friction: jax.Array = positive("-", default=1.0)

    def __check_init__(self):
        check("Banked.bank", self.bank, lambda v: abs(v) < math.pi / 2, "within a quarter turn", "It is in rad.")

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.bank)
        return surface(s, y, self.friction, bank=self.bank * smooth_step((s - self.start) / self.ramp))
