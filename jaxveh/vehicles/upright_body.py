"""Two-track cars without roll."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any

import jax

from jaxveh._core.errors import check
from jaxveh._core.parameter import parameter
from jaxveh.vehicles.base import Motion
from jaxveh.vehicles.load_transfer import planar_loads
from jaxveh.vehicles.two_track import AbstractLoadedTwoTrack
from jaxveh.vehicles.wheels import Wheels


class AbstractUprightTwoTrack(AbstractLoadedTwoTrack):
    """A two-track car without roll: its speed states are those of its centre of gravity.

    **Parameters** of the upright body: `front_roll_share` (-), the front axle's share of the lateral load transfer (None: as the
    static loads are shared).
    """

    _: KW_ONLY
    front_roll_share: jax.Array | None = parameter("-", scale=0.1, default=None)

    def __check_init__(self):
        name = f"{type(self).__name__}.front_roll_share"
        if self.front_roll_share is not None:
            check(name, self.front_roll_share, lambda v: (v >= 0) & (v <= 1), "between 0 and 1")

    def motion(self, x, u):
        return Motion(0.0, 0.0, x.yaw, self.told_or_own_speed(x, u), x.v_y, x.yaw_rate)

    def wheel_speed(self, x, u):
        return self.told_or_own_speed(x, u)

    def loads(self, x: Any, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
        return planar_loads(self, a_x, a_y, g_z)
