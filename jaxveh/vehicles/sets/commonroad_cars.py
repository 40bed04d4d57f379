"""The vehicles of CommonRoad: measured cars that many papers use.

Their tyres have the same stiffness over load in front and at the rear, so that all the cars are neutral: the understeer
gradient is zero.
"""

from __future__ import annotations

from typing import Any

from jaxveh.io import CommonRoadSpecification
from jaxveh.vehicles.sets.from_commonroad import from_commonroad
from jaxveh.vehicles.sets.numbers import CarNumbers

SOURCE = (
    "CommonRoad vehicle {} ({}): M. Althoff & G. Würsching, CommonRoad: Vehicle Models, 2020, table 6, to five digits, after "
    "R. W. Allen et al., Vehicle Dynamic Stability and Rollover, US Department of Transportation, 1992"
)

TYRE = {
    "p_cx1": 1.6411, "p_dx1": 1.1739, "p_ex1": 0.46403, "p_kx1": 22.303, "p_hx1": 0.0012297, "p_vx1": -8.8098e-6,
    "r_bx1": 13.276, "r_bx2": -13.778, "r_cx1": 1.2568, "r_ex1": 0.65225, "r_hx1": 0.0050722,
    "p_cy1": 1.3507, "p_dy1": 1.0489, "p_dy3": -2.8821, "p_ey1": -0.0074722, "p_ky1": -21.92,
    "p_hy1": 0.0026747, "p_hy3": 0.031415, "p_vy1": 0.037318, "p_vy3": -0.32931,
    "r_by1": 7.1433, "r_by2": 9.1916, "r_by3": -0.027856, "r_cy1": 1.0719, "r_ey1": -0.27572, "r_hy1": 5.7448e-6,
    "r_vy1": -0.027825, "r_vy3": -0.27568, "r_vy4": 12.12, "r_vy5": 1.9, "r_vy6": -10.704,
}  # fmt: skip
"""The tyre of all CommonRoad cars, PAC2002 from the handbook of ADAMS (the same paper, table 7)."""

COMMON: dict[str, Any] = {
    "steer_rate_min": -0.4, "steer_rate_max": 0.4, "acceleration_max": 11.5, "wheel_inertia": 1.7, "wheel_radius": 0.344,
    "roll_centre_front": 0.0, "roll_centre_rear": 0.0, "roll_yaw_product": 0.0, "tyre": TYRE,
}  # fmt: skip


def ford_escort() -> CommonRoadSpecification:
    """Vehicle 1, a Ford Escort."""
    return CommonRoadSpecification(
        length=4.298, width=1.674, steer_min=-0.91, steer_max=0.91, speed_min=-13.9, speed_max=45.8, switching_speed=4.755,
        mass=1225.9, sprung_mass=1094.5, unsprung_mass_front=65.673, unsprung_mass_rear=65.673,
        front_axle_to_cg=0.88392, rear_axle_to_cg=1.50876, roll_inertia=244.05, pitch_inertia=1342.3, yaw_inertia=1538.9,
        spring_front=21898.0, spring_rear=21898.0, damper_front=1459.4, damper_rear=1459.4,
        track_front=1.3899, track_rear=1.4234, torsion_front=-12880.0, torsion_rear=0.0, tyre_stiffness=189790.0,
        cg_height=0.55778, sprung_cg_height=0.59436, front_brake=0.76, front_drive=1.0, **COMMON,
    )  # fmt: skip


def bmw_320i() -> CommonRoadSpecification:
    """Vehicle 2, a BMW 320i."""
    return CommonRoadSpecification(
        length=4.508, width=1.61, steer_min=-1.066, steer_max=1.066, speed_min=-13.9, speed_max=50.8, switching_speed=7.319,
        mass=1093.3, sprung_mass=965.71, unsprung_mass_front=63.792, unsprung_mass_rear=63.792,
        front_axle_to_cg=1.1562, rear_axle_to_cg=1.4227, roll_inertia=207.27, pitch_inertia=1565.8, yaw_inertia=1791.6,
        spring_front=24453.0, spring_rear=19636.0, damper_front=1786.2, damper_rear=1649.1,
        track_front=1.3868, track_rear=1.3640, torsion_front=-6914.9, torsion_rear=-2643.6, tyre_stiffness=158290.0,
        cg_height=0.57487, sprung_cg_height=0.61373, front_brake=0.66, front_drive=0.0, **COMMON,
    )  # fmt: skip


def vw_vanagon() -> CommonRoadSpecification:
    """Vehicle 3, a VW Vanagon."""
    return CommonRoadSpecification(
        length=4.569, width=1.844, steer_min=-1.023, steer_max=1.023, speed_min=-11.2, speed_max=41.7, switching_speed=7.824,
        mass=1478.9, sprung_mass=1316.6, unsprung_mass_front=81.144, unsprung_mass_rear=81.144,
        front_axle_to_cg=1.1508, rear_axle_to_cg=1.3211, roll_inertia=479.88, pitch_inertia=2204.3, yaw_inertia=2473.1,
        spring_front=33577.0, spring_rear=39125.0, damper_front=2405.6, damper_rear=2769.7,
        track_front=1.5743, track_rear=1.5438, torsion_front=-33948.0, torsion_rear=-7731.4, tyre_stiffness=212640.0,
        cg_height=0.74782, sprung_cg_height=0.80449, front_brake=0.64, front_drive=0.0, **COMMON,
    )  # fmt: skip


def semi_trailer_truck() -> CommonRoadSpecification:
    """Vehicle 4, a tractor with a semi-trailer on its rear axle: only lengths and limits."""
    return CommonRoadSpecification(
        length=5.1, width=2.55, steer_min=-0.55, steer_max=0.55, steer_rate_min=-0.7103, steer_rate_max=0.7103,
        speed_min=-2.78, speed_max=22.22, switching_speed=7.824, acceleration_max=11.5, front_axle_to_cg=1.8,
        rear_axle_to_cg=1.8, trailer_length=13.6, trailer_width=2.55, hitch_length=12.0, total_length=16.5,
        trailer_wheelbase=8.1,
    )  # fmt: skip


def compact_car() -> CarNumbers:
    """A Ford Escort, front-wheel drive, 1226 kg: CommonRoad's vehicle 1, measured for the American DOT."""
    return from_commonroad(ford_escort(), "compact_car", SOURCE.format(1, "Ford Escort"))


def sedan() -> CarNumbers:
    """A BMW 320i, rear-wheel drive, 1093 kg: CommonRoad's vehicle 2, measured for the American DOT."""
    return from_commonroad(bmw_320i(), "sedan", SOURCE.format(2, "BMW 320i"))


def van() -> CarNumbers:
    """A VW Vanagon, rear-wheel drive, 1479 kg: CommonRoad's vehicle 3, measured for the American DOT."""
    return from_commonroad(vw_vanagon(), "van", SOURCE.format(3, "VW Vanagon"))


def semi_trailer() -> CarNumbers:
    """A tractor with a semi-trailer, CommonRoad's vehicle 4: only lengths, for kinematic cars."""
    source = "CommonRoad vehicle 4 (semi-trailer truck): M. Althoff & G. Würsching, CommonRoad: Vehicle Models, 2020"
    return from_commonroad(semi_trailer_truck(), "semi_trailer", source)
