"""What all cars on four wheels have in common: parameters, tyres, units, and the outputs that they offer."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.names import check_names, record_type
from jaxveh._core.parameter import check_parameters
from jaxveh.roads import Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.base import AbstractVehicle, Motion
from jaxveh.vehicles.wheels import (
    BodyForces,
    Tyres,
    Wheels,
    contact,
    corners,
    each_wheel,
    frictions,
    rolling,
    wheel_names,
)

UNITS = {
    **dict.fromkeys(("v_x", "v_y"), "m/s"),
    **dict.fromkeys(("a_x", "a_y", "a_x_felt", "a_y_felt", "v_x_rate"), "m/s^2"),
    **dict.fromkeys(("steer", "yaw", "roll", "sideslip", *wheel_names("slip_angle")), "rad"),
    **dict.fromkeys(("yaw_rate", "roll_rate", *wheel_names("omega")), "rad/s"),
    **dict.fromkeys(("yaw_acceleration", "roll_acceleration"), "rad/s^2"),
    **dict.fromkeys(wheel_names("slip_ratio"), "-"),
    **dict.fromkeys(("F_x", "F_y", *wheel_names("load"), *wheel_names("F_x"), *wheel_names("F_y")), "N"),
    **dict.fromkeys(("M_z", "drive_torque", "brake_torque", *wheel_names("torque"), *wheel_names("M_z")), "N m"),
    "drive_power": "W",
}
"""Units of what two-track cars have as states, inputs and outputs."""


class AbstractTwoTrack(AbstractVehicle):
    """A car on four wheels: what its kinds share. Each has the fields of `positions_of`."""

    @property
    def units(self):
        return dict(UNITS)

    @property
    def wheel_positions(self):
        return tuple(positions_of(self))


class AbstractPlanarTwoTrack(AbstractTwoTrack):
    """A two-track car that stays upright: its states are the speeds of its centre of gravity."""

    def motion(self, x, u):
        # The speed is a state, or given.
        return Motion(0.0, 0.0, x.yaw, x.v_x if hasattr(x, "v_x") else u.v_x, x.v_y, x.yaw_rate)


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


def rolling_wheels(car: Any, v_x: Any, v_y: Any, yaw_rate: Any, steer: Any) -> Wheels:
    """How the wheels move over the road; both front wheels turn by the steer (rad)."""
    turn = numerics.barrier((numerics.cos(steer), numerics.sin(steer)))
    turned = Wheels(turn, turn, (1.0, 0.0), (1.0, 0.0))
    return each_wheel(lambda at, one: rolling(at, v_x, v_y, yaw_rate, *one), positions_of(car), turned)


def touching(car: Any, moves: Wheels, loads: Wheels, ground: Ground, speeds: Wheels | None = None) -> Wheels:
    """How the wheels touch the road; `speeds` are `omega r_e` (m/s), None where all roll freely."""
    speeds = Wheels(None, None, None, None) if speeds is None else speeds
    return each_wheel(
        lambda m, load, mu, v: contact(m, load, mu, car.crawl_speed, v), moves, loads, frictions(ground), speeds
    )


def state_type(car: Any, name: str, body: tuple[str, ...]) -> Any:
    """The states of the body, then those of the load transfer and of dynamic tyres (`fl_<name>` ...)."""
    return record_type(name, (*body, *car.load_transfer.state_names, *tyres_of(car).state_names))


def started(car: Any, body: dict, like: Any, values: dict, contacts_of: Any) -> Any:
    """The state with `values` given by name, all else as `body` says, of the shape of `like`; dynamic tyres have settled.

    `body` has the body's states: a number, or a function of the given values. `contacts_of(x)` are the contacts in a state `x`
    of the body and the load transfer, whose felt accelerations are zero.
    """
    check_names("start", values, car.state_type._fields)
    dtype = jnp.result_type(car.mass)
    given = {name: jnp.asarray(value, dtype) for name, value in values.items()}
    zero = jnp.zeros(jnp.shape(like), dtype)
    rest = {name: zero if value is None else value(given, zero) for name, value in body.items()}
    rest |= dict(zip(car.load_transfer.state_names, car.load_transfer.start((zero, zero)), strict=True))
    rest |= {name: value for name, value in given.items() if name in rest}
    x = record_type("Body", tuple(rest))(*rest.values())
    return car.state_type(*x, *tyres_of(car).start(contacts_of(x)))._replace(**given)


def air_drag(drag: Any, v_x: Any) -> Any:
    """Drag of the air against the motion, N: `drag` (N s^2/m^2) is half the air's density times c_W times the area."""
    return drag * v_x * jnp.abs(v_x)


def wheel_outputs(contacts: Wheels, forces: Wheels, omegas: Wheels | None = None) -> dict:
    """What each wheel says, in its own axes: slips, loads, forces, aligning moments, spins; without `omegas` no slip ratio."""
    shown = {}
    for name in ("slip_angle", "load") if omegas is None else ("slip_angle", "slip_ratio", "load"):
        shown |= zip(wheel_names(name), (getattr(at, name) for at in contacts), strict=True)
    for name in ("F_x", "F_y", "M_z"):
        shown |= zip(wheel_names(name), (getattr(f, name) for f in forces), strict=True)
    return shown if omegas is None else shown | dict(zip(wheel_names("omega"), omegas, strict=True))


def body_outputs(moves: Motion, a_x: Any, a_y: Any, yaw_acceleration: Any, steer: Any, push: BodyForces) -> dict:
    """What the body says: speeds, accelerations (of an ideal accelerometer), sideslip, and the wheels' forces on it."""
    return {
        "v_x": moves.v_x,
        "v_y": moves.v_y,
        "yaw": moves.yaw,
        "yaw_rate": moves.yaw_rate,
        "yaw_acceleration": yaw_acceleration,
        "a_x": a_x,
        "a_y": a_y,
        "sideslip": numerics.arctan2(moves.v_y, moves.v_x),
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
