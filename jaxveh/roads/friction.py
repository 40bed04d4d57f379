"""Level roads with one friction, with two side by side, or with one after the other."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import parameter, positive
from jaxveh.numerics import smooth_step
from jaxveh.roads.base import AbstractRoad, Surface, place, surface


class Level(AbstractRoad):
    """A level road with one `friction` (-, default 1).

    **Raises** `InputError` for a friction that is not positive.
    """

    friction: jax.Array = positive("-", default=1.0)

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        return surface(*place(s, y, self.friction), self.friction)


class SplitMu(AbstractRoad):
    """A level road with one friction on the left and another on the right, blended smoothly about their border.

    `left`, `right` (-): frictions. `blend` (m, default 0.2): the width of the transition between them. `border` (m,
    default 0): the position of the transition's middle, positive to the left of the centre line.

    **Raises** `InputError` for a friction or blend that is not positive.
    """

    left: jax.Array = positive("-")
    right: jax.Array = positive("-")
    blend: jax.Array = positive("m", default=0.2)
    border: jax.Array = parameter("m", scale=1.0, default=0.0)

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.left)
        share = smooth_step((y - self.border) / self.blend + 0.5)
        return surface(s, y, self.right + (self.left - self.right) * share)


class MuJump(AbstractRoad):
    """A level road whose friction changes once along the road.

    `before`, `after` (-): frictions. `at_distance` (m): where the change begins; `ramp` (m, default 0.5): the length over
    which the friction changes smoothly.

    **Raises** `InputError` for a friction or ramp that is not positive.
    """

    before: jax.Array = positive("-")
    after: jax.Array = positive("-")
    at_distance: jax.Array = parameter("m", scale=10.0)
    ramp: jax.Array = positive("m", default=0.5)

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.before)
        share = smooth_step((s - self.at_distance) / self.ramp)
        return surface(s, y, self.before + (self.after - self.before) * share)
