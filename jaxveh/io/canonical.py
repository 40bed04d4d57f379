"""The channels that the package knows by name, with their SI units and axes (ISO 8855: x forward, y left, z up)."""

from __future__ import annotations

from typing import NamedTuple

from jaxveh._core.recording import TRUTH


class CanonicalChannel(NamedTuple):
    """The `unit` in which the package uses a channel, and the `meaning` of the channel."""

    unit: str
    meaning: str


WHEELS = (("fl", "front left"), ("fr", "front right"), ("rl", "rear left"), ("rr", "rear right"))

CANONICAL: dict[str, CanonicalChannel] = {
    name: CanonicalChannel(unit, meaning)
    for name, unit, meaning in (
        ("time", "s", "time stamp, strictly increasing"),
        ("v_x", "m/s", "longitudinal speed at the centre of gravity"),
        ("v_y", "m/s", "lateral speed at the centre of gravity, positive to the left"),
        ("speed", "m/s", "magnitude of the velocity over ground"),
        ("sideslip", "rad", "atan2(v_y, v_x)"),
        ("yaw", "rad", "heading, positive to the left, unwrapped"),
        ("course", "rad", "direction of the velocity over ground, positive to the left"),
        ("heading", "rad", "direction of the car over ground measured with two antennas, positive to the left"),
        ("climb_rate", "m/s", "vertical speed, positive upwards"),
        ("lane_offset", "m", "lateral position relative to the middle of the lane, positive to the left of it"),
        ("lane_heading", "rad", "direction of the car relative to that of the lane, positive to the left"),
        ("yaw_rate", "rad/s", "positive to the left"),
        ("roll", "rad", "positive when the left side rises"),
        ("roll_rate", "rad/s", "about the x axis"),
        ("pitch", "rad", "positive when the nose dips"),
        ("pitch_rate", "rad/s", "about the y axis"),
        ("x", "m", "position, ground frame"),
        ("y", "m", "position, ground frame"),
        ("z", "m", "position, ground frame, upward"),
        ("a_x", "m/s^2", "longitudinal acceleration as an accelerometer measures it"),
        ("a_y", "m/s^2", "lateral acceleration as an accelerometer measures it, positive to the left"),
        ("a_z", "m/s^2", "vertical acceleration as an accelerometer measures it"),
        ("steer", "rad", "mean angle of the front road wheels, positive to the left"),
        ("steer_rear", "rad", "mean angle of the rear road wheels, positive to the left"),
        ("steer_left", "rad", "the same as steer_fl, the name in logs of cars with front steering"),
        ("steer_right", "rad", "the same as steer_fr"),
        *[(f"steer_{at}", "rad", f"angle of the {wheel} road wheel, positive to the left") for at, wheel in WHEELS],
        ("steering_wheel", "rad", "angle of the steering wheel, positive to the left"),
        ("steering_wheel_rate", "rad/s", "speed of the steering wheel"),
        ("steering_torque", "N*m", "torque at the steering wheel"),
        *[(f"omega_{at}", "rad/s", f"rotation of the {wheel} wheel, positive forward") for at, wheel in WHEELS],
        *[(f"wheel_speed_{at}", "m/s", f"rotation of the {wheel} wheel times its radius") for at, wheel in WHEELS],
        *[(f"load_{at}", "N", f"wheel load, {wheel}") for at, wheel in WHEELS],
        *[(f"torque_{at}", "N*m", f"torque on the {wheel} wheel, positive when it drives") for at, wheel in WHEELS],
        ("throttle", "1", "driver's demand, 0 to 1"),
        ("brake_pressure", "Pa", "brake line pressure"),
        ("drive_torque", "N*m", "sum of the driving torques at the wheels"),
        ("brake_torque", "N*m", "sum of the braking torques at the wheels"),
        ("grade", "rad", "slope of the road, positive uphill"),
        ("bank", "rad", "cross slope of the road"),
        ("friction", "1", "friction coefficient of the road"),
        ("slip_angle_front", "rad", "front axle, positive slip angle gives positive lateral force"),
        ("slip_angle_rear", "rad", "rear axle, positive slip angle gives positive lateral force"),
        ("F_yf", "N", "lateral force of the front axle, wheel axes"),
        ("F_yr", "N", "lateral force of the rear axle, wheel axes"),
    )
}
"""The known channels, name to unit and meaning. Other names are allowed everywhere; they keep the unit of their file."""


def canonical_unit(name: str) -> str | None:
    """Return the SI unit of a channel, of a simulation's `true.` channel or of `<channel>_std`; None for an unknown name."""
    plain = name.removeprefix(TRUTH)
    found = CANONICAL.get(plain) or CANONICAL.get(plain.removesuffix("_std"))
    return found.unit if found else None
