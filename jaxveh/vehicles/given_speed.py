"""Cars whose forward speed is an input, and their longitudinal acceleration."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx

from jaxveh.roads import Ground
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, QuasiStatic
from jaxveh.vehicles.two_track import AbstractLoadedTwoTrack


def longitudinal_acceleration(x: Any, u: Any, g_x: Any = 0.0) -> Any:
    """The signal of an ideal accelerometer at the centre of gravity along x, m/s^2.

    It is the input `a_x` if there is one, otherwise `dv_x/dt - v_y r - g_x` with the input `v_x_rate`. With neither input the
    speed is assumed constant. `g_x` (m/s^2) is gravity along a sloping road.
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
