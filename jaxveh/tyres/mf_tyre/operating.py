"""The operating point: what every equation of MF-Tyre looks at, prepared once."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh.tyres.mf_tyre.turn_slip import NO_SPIN, Spin


class Operating(NamedTuple):
    """One instant of one wheel, in the signs of ISO-W; arrays that broadcast against each other.

    `load` (N), `moment_load` (N; not below the range's least load, for moments), `slip_ratio` (-), `slip_angle`, `camber`
    (rad), `speed` (m/s), `pressure` (Pa), all within the tyre's ranges; `df_z`, `dp_i` (-) the increments of load and pressure
    (4.E2); `tangent`, `sine` the slip angle's tangent and the camber's sine, or the angles themselves in mode 1 (4.E3, 4.E4);
    `mu_x`, `mu_y` (-) the friction scales with the road's in them; `smooth` (-) what is left of shifts at low speed; `direction`
    (-) that of travel, sgn V_cx of the book; `spin` what turn slip does; `bounded`: curvatures are held at 1.
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
    direction: Any = 1.0
    spin: Spin = NO_SPIN
    bounded: bool = True
