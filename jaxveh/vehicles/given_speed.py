"""What a car whose forward speed is an input knows of its acceleration."""

from __future__ import annotations

from typing import Any


def longitudinal_acceleration(x: Any, u: Any, g_x: Any = 0.0) -> Any:
    """What an ideal accelerometer at the centre of gravity says along x, m/s^2.

    The input `a_x` where there is one, else `dv_x/dt - v_y r - g_x` with the input `v_x_rate`; the speed is constant if nobody
    says. `g_x` (m/s^2) is gravity along a sloping road.
    """
    if hasattr(u, "a_x"):
        return u.a_x
    turning = x.v_y * x.yaw_rate + g_x
    return u.v_x_rate - turning if hasattr(u, "v_x_rate") else -turning
