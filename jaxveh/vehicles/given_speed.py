"""What a car whose forward speed is an input knows of its acceleration."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx

from jaxveh.roads import Ground
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, QuasiStatic
from jaxveh.vehicles.two_track import AbstractLoadedTwoTrack


def longitudinal_acceleration(x: Any, u: Any, g_x: Any = 0.0) -> Any:
    """What an ideal accelerometer at the centre of gravity says along x, m/s^2.

    The input `a_x` where there is one, else `dv_x/dt - v_y r - g_x` with the input `v_x_rate`; the speed is constant if nobody
    says. `g_x` (m/s^2) is gravity along a sloping road.
    """
    if hasattr(u, "a_x"):
        return u.a_x
    turning = x.v_y * x.yaw_rate + g_x
    return u.v_x_rate - turning if hasattr(u, "v_x_rate") else -turning


class AbstractToldSpeed(AbstractLoadedTwoTrack):
    """A two-track car that rolls freely at a given forward speed."""

    _: KW_ONLY
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=QuasiStatic)

    @property
    def inputs(self):
        return (*self.steering.inputs, "v_x", *self.load_transfer.inputs)

    def steady_a_x(self, x, u, ground: Ground, g: tuple[Any, Any, Any]):
        del ground
        return longitudinal_acceleration(self.motion(x, u), u, g[0])
