"""What all cars on four wheels have in common: parameters, tyres, units, and the outputs that they offer."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.parameter import check_parameters
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.wheels import Pushed, Tyres, Wheels, corners, named

UNITS = {
    **dict.fromkeys(("v_x", "v_y"), "m/s"),
    **dict.fromkeys(("a_x", "a_y", "a_x_felt", "a_y_felt", "v_x_rate"), "m/s^2"),
    **dict.fromkeys(("steer", "yaw", "sideslip", *named("slip_angle")), "rad"),
    **dict.fromkeys(("yaw_rate", *named("omega")), "rad/s"),
    "yaw_acceleration": "rad/s^2",
    **dict.fromkeys(named("slip_ratio"), "-"),
    **dict.fromkeys(("F_x", "F_y", *named("load"), *named("F_x"), *named("F_y")), "N"),
    **dict.fromkeys(("M_z", "drive_torque", "brake_torque", *named("torque"), *named("M_z")), "N m"),
    "drive_power": "W",
}
"""Units of what two-track cars have as states, inputs and outputs."""


def check_car(car: Any) -> None:
    """Raise `InputError` unless the car's parameters are in their domains, its tyres are tyres and its shares are shares."""
    check_parameters(car)
    kind = type(car).__name__
    for name in ("front", "rear"):
        tyre = getattr(car, name)
        if not isinstance(tyre, AbstractTyre):
            raise InputError(f"{kind}.{name} = {type(tyre).__name__}: must be a tyre of jaxveh.tyres.")
    check(f"{kind}.crawl_speed", car.crawl_speed, lambda v: v > 0, "positive (m/s)")
    share = getattr(car, "front_roll_share", None)
    check(f"{kind}.front_roll_share", share, lambda v: (v >= 0) & (v <= 1), "between 0 and 1")


def tyres_of(car: Any) -> Tyres:
    """The tyres on the car's wheels."""
    return Tyres(car.front, car.rear, car.mirrored)


def positions_of(car: Any) -> Wheels:
    """(x, y), m, of the wheels from the centre of gravity."""
    return corners(car.front_axle_to_cg, car.rear_axle_to_cg, car.track_front, car.track_rear)


def air_drag(drag: Any, v_x: Any) -> Any:
    """Drag of the air against the motion, N: `drag` (N s^2/m^2) is half the air's density times c_W times the area."""
    return drag * v_x * jnp.abs(v_x)


def wheel_outputs(contacts: Wheels, forces: Wheels, omegas: Wheels) -> dict:
    """What each wheel says, in its own axes: slips, loads, forces, aligning moments, spins."""
    shown = {}
    for name in ("slip_angle", "slip_ratio", "load"):
        shown |= zip(named(name), (getattr(at, name) for at in contacts), strict=True)
    for name in ("F_x", "F_y", "M_z"):
        shown |= zip(named(name), (getattr(f, name) for f in forces), strict=True)
    return shown | dict(zip(named("omega"), omegas, strict=True))


def body_outputs(x: Any, v_x: Any, a_x: Any, a_y: Any, yaw_acceleration: Any, steer: Any, push: Pushed) -> dict:
    """What the body says: speeds, accelerations (of an ideal accelerometer), sideslip, and the wheels' forces on it."""
    return {
        "v_x": v_x,
        "v_y": x.v_y,
        "yaw": x.yaw,
        "yaw_rate": x.yaw_rate,
        "yaw_acceleration": yaw_acceleration,
        "a_x": a_x,
        "a_y": a_y,
        "sideslip": numerics.arctan2(x.v_y, v_x),
        "steer": steer,
        "F_x": push.F_x,
        "F_y": push.F_y,
        "M_z": push.M_z,
    }


def filled(values: dict, like: Any) -> dict:
    """The same values, with Python numbers as arrays of the dtype and shape of `like`."""
    return {
        name: value if hasattr(value, "dtype") else jnp.full(jnp.shape(like), value, like.dtype)
        for name, value in values.items()
    }
