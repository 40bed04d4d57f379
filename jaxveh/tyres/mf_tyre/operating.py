"""The operating point: the inputs of all equations of MF-Tyre, computed once."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh.tyres.mf_tyre.turn_slip import NO_SPIN, Spin


class Operating(NamedTuple):
    """One wheel at one instant, with the signs of ISO-W; arrays that broadcast against each other.

    `load` (N), `moment_load` (N; at least the range's least load, for moments), `slip_ratio` (-), `slip_angle`, `camber` (rad),
    `speed` (m/s) and `pressure` (Pa), all within the tyre's ranges. `df_z`, `dp_i` (-): the increments of load and pressure
    (4.E2). `tangent`, `sine`: the slip angle's tangent and the camber's sine, or the angles themselves in mode 1 (4.E3, 4.E4).
    `mu_x`, `mu_y` (-): the friction scales times the road's friction. `smooth` (-): the factor of shifts at low speed.
    `direction` (-): the direction of travel, sgn V_cx of the book. `spin`: the factors of turn slip. `bounded`: whether
    curvatures are limited to 1.
    """

    load: Any
    moment_load: Any
    slip_ratio: Any
    slip_angle: Any
    camber: Any
    speed: Any
    pressure: Any
    df_z: Any
    dp_i: Any
    tangent: Any
    sine: Any
    mu_x: Any
    mu_y: Any
    smooth: Any
    direction: Any
    spin: Spin = NO_SPIN
    bounded: bool = True
