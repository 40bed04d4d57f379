"""An estimated suspension for cars without a measured one."""

from __future__ import annotations

import math

from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.sets.numbers import SuspensionNumbers

RIDE_FRONT, RIDE_REAR = 1.3, 1.5
"""Hz: the natural frequencies of the body on its front and rear springs."""
DAMPING = 0.27
"""The damping ratio of the body on its springs."""
ROLL_RADIUS = 0.34
"""The radius of gyration of the sprung mass in roll over the mean track."""
PITCH_OVER_YAW = 1.04
"""The pitch inertia of the sprung mass over its yaw inertia."""
TYRE_STIFFNESS = 50.0
"""1/m: the vertical stiffness of a tyre over its load at rest."""


def estimated_suspension(
    *,
    mass: float,
    yaw_inertia: float,
    front_axle_to_cg: float,
    rear_axle_to_cg: float,
    cg_height: float,
    track_front: float,
    track_rear: float,
    wheel_radius: float,
    unsprung_mass_front: float,
    unsprung_mass_rear: float,
) -> SuspensionNumbers:
    """The suspension of an ordinary car for a car whose other numbers are known: **our own estimate**.

    Frequencies, damping ratio, roll and pitch inertia and the tyre's stiffness are about those of the measured cars of CommonRoad
    (`commonroad_cars`). Anti-roll bars have 0.2 and 0.05 of the springs' stiffness, and roll centres are 0.05 m and 0.1 m high.
    The position and the yaw inertia of the sprung mass follow from those of the car, with the unsprung masses as point masses in
    the wheels' centres. All arguments have the names and units of `CarNumbers` and `SuspensionNumbers`.
    """
    a, b = front_axle_to_cg, rear_axle_to_cg
    length, front, rear = a + b, 2.0 * unsprung_mass_front, 2.0 * unsprung_mass_rear
    sprung = mass - front - rear
    a_s = (mass * a - rear * length) / sprung
    # The yaw inertia of all masses as points about the whole car's centre of gravity.
    turning = front * (a**2 + 0.25 * track_front**2) + rear * (b**2 + 0.25 * track_rear**2) + sprung * (a - a_s) ** 2
    k_front = (2.0 * math.pi * RIDE_FRONT) ** 2 * 0.5 * sprung * (length - a_s) / length
    k_rear = (2.0 * math.pi * RIDE_REAR) ** 2 * 0.5 * sprung * a_s / length
    return SuspensionNumbers(
        sprung_mass=sprung,
        unsprung_mass_front=unsprung_mass_front,
        unsprung_mass_rear=unsprung_mass_rear,
        roll_inertia=sprung * (ROLL_RADIUS * 0.5 * (track_front + track_rear)) ** 2,
        pitch_inertia=PITCH_OVER_YAW * (yaw_inertia - turning),
        yaw_inertia=yaw_inertia - turning,
        front_axle_to_cg=a_s,
        rear_axle_to_cg=length - a_s,
        cg_height=(mass * cg_height - (front + rear) * wheel_radius) / sprung,
        spring_front=k_front,
        spring_rear=k_rear,
        damper_front=2.0 * DAMPING * k_front / (2.0 * math.pi * RIDE_FRONT),
        damper_rear=2.0 * DAMPING * k_rear / (2.0 * math.pi * RIDE_REAR),
        tyre_stiffness=TYRE_STIFFNESS * 0.25 * mass * GRAVITY,
        anti_roll_front=0.2 * k_front,
        anti_roll_rear=0.05 * k_rear,
        roll_centre_front=0.05,
        roll_centre_rear=0.1,
    )
