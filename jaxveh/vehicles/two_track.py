"""The common part of all cars on four wheels: parameters, tyres, units and outputs."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import OVER_GROUND, Motion, over_ground
from jaxveh.vehicles.load_transfer import AbstractShiftingLoads
from jaxveh.vehicles.shared import AbstractOnTyres
from jaxveh.vehicles.steering import STEER_UNITS
from jaxveh.vehicles.wheels import (
    BodyForces,
    Tyres,
    Wheels,
    contact,
    corners,
    each_wheel,
    frictions,
    gravity,
    is_straight,
    rolling,
    wheel_names,
)

UNITS = {
    **dict.fromkeys(("v_x", "v_y"), "m/s"),
    **dict.fromkeys(("a_x", "a_y", "a_x_felt", "a_y_felt", "v_x_rate"), "m/s^2"),
    **dict.fromkeys(("yaw", "roll", "sideslip", *wheel_names("slip_angle")), "rad"),
    **dict.fromkeys(("yaw_rate", "roll_rate", *wheel_names("omega")), "rad/s"),
    **dict.fromkeys(("yaw_acceleration", "roll_acceleration"), "rad/s^2"),
    **dict.fromkeys(wheel_names("slip_ratio"), "-"),
    **dict.fromkeys(("F_x", "F_y", *wheel_names("load"), *wheel_names("F_x"), *wheel_names("F_y")), "N"),
    **dict.fromkeys(("M_z", "drive_torque", "brake_torque", *wheel_names("torque"), *wheel_names("M_z")), "N m"),
    "drive_power": "W",
    **OVER_GROUND,
    **STEER_UNITS,
}
"""The units of the states, inputs and outputs of two-track cars."""


class AbstractTwoTrack(AbstractOnTyres):
    """A car on four wheels.

    **Parameters** of the four wheels: `track_front`, `track_rear` (m, between the wheels' middles), `mirrored`: whether the tyres
    of the right wheels are mirror images of the left ones (by default they are), `cg_height` (m, over the road).
    """

    _: KW_ONLY
    track_front: jax.Array = positive("m")
    track_rear: jax.Array = positive("m")
    cg_height: jax.Array = positive("m")
    mirrored: bool = eqx.field(static=True, default=True)

    @property
    def tyres(self) -> Tyres:
        return Tyres(self.front, self.rear, self.mirrored)

    @property
    def units(self):
        return dict(UNITS)

    @property
    def wheel_positions(self):
        return tuple(self.places)

    @property
    def places(self) -> Wheels:
        """The positions (x, y), m, of the wheels relative to the centre of gravity."""
        return corners(self.front_axle_to_cg, self.rear_axle_to_cg, self.track_front, self.track_rear)


class OnRoad(NamedTuple):
    """The wheels of a car on the road: their angles (rad), contacts and motions, the forces on them in their axes, and the
    derivatives of the states of dynamic tyres."""

    steers: Wheels
    contacts: Wheels
    moves: Wheels
    forces: Wheels
    tyre_rates: tuple


class AbstractLoadedTwoTrack(AbstractTwoTrack, AbstractShiftingLoads):
    """A two-track car whose wheels stay on the road; their loads follow from the accelerations that `load_transfer` gives.

    Subclasses define these accelerations in a steady turn and how the loads depend on them.
    """

    body_states: eqx.AbstractClassVar[tuple[str, ...]]
    """The names of the states of body and wheels."""

    @property
    def own_states(self):
        return (*self.body_states, *self.load_transfer.state_names)

    def told_or_own_speed(self, x: Any, u: Any) -> Any:
        """The forward speed, m/s: the state `v_x` if there is one, otherwise the input."""
        return x.v_x if "v_x" in self.body_states else u.v_x

    @abc.abstractmethod
    def wheel_speed(self, x: Any, u: Any) -> Any:
        """The forward speed, m/s, of the reference point of the wheels' positions."""

    @abc.abstractmethod
    def steady_a_x(self, x: Any, u: Any, ground: Ground, g: tuple[Any, Any, Any]) -> Any:
        """The longitudinal acceleration, m/s^2, computed without any tyre force, under gravity `g` (m/s^2)."""

    @abc.abstractmethod
    def loads(self, x: Any, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
        """The wheel loads, N, under the accelerations `a_x`, `a_y` and the gravity `g_z` normal to the road (m/s^2)."""

    def rim_speeds(self, x: Any) -> Wheels:
        """`omega r_e` of each wheel, m/s; None for cars without wheel spin as a state."""
        del x
        return Wheels(None, None, None, None)

    def contacts(self, x, u, ground: Ground = LEVEL) -> Wheels:
        return self._stand(x, u, ground)[1]

    def on_road(self, x: Any, u: Any, ground: Ground) -> OnRoad:
        """The wheels on the road: angles, contacts, motions, forces and derivatives of tyre states."""
        steers, contacts, moves = self._stand(x, u, ground)
        tyres = self.tyres
        states = tyres.states(x)
        return OnRoad(steers, contacts, moves, tyres.forces(contacts, states), tyres.rates(contacts, states))

    def _stand(self, x, u, ground: Ground) -> tuple[Wheels, Wheels, Wheels]:
        """The angles, contacts and motions of the wheels."""
        steers = self.steering.angles(self, u, self.told_or_own_speed(x, u))
        moves = rolling_wheels(self.places, self.wheel_speed(x, u), x.v_y, x.yaw_rate, steers)
        g = _, g_y, g_z = gravity(ground)
        steady = self.steady_a_x(x, u, ground, g), self.told_or_own_speed(x, u) * x.yaw_rate - g_y
        loads = self.loads(x, *self.load_transfer.felt_accelerations(x, u, steady), g_z)
        touching = lambda move, load, mu, speed: contact(move, load, mu, self.slip_floor, speed)
        return steers, each_wheel(touching, moves, loads, frictions(ground), self.rim_speeds(x)), moves


def rolling_wheels(places: Wheels, v_x: Any, v_y: Any, yaw_rate: Any, steers: Wheels) -> Wheels:
    """The motions over the road of wheels at `places` ((x, y), m) with the angles `steers` (rad)."""
    return each_wheel(lambda at, one: rolling(at, v_x, v_y, yaw_rate, *one), places, directions(steers))


def directions(steers: Wheels) -> Wheels:
    """(cosine, sine) of each wheel's angle, computed once for wheels with the same angle; (1.0, 0.0) if it is never steered."""
    found = {id(angle): (1.0, 0.0) if is_straight(angle) else _cosine_and_sine(angle) for angle in steers}
    return each_wheel(lambda angle: found[id(angle)], steers)


@numerics.fence_results
def _cosine_and_sine(steer: Any) -> tuple[Any, Any]:
    return numerics.cos(steer), numerics.sin(steer)


def air_drag(drag: Any, v_x: Any) -> Any:
    """The air drag, N, positive forwards: `drag` (N s^2/m^2) is half the air's density times c_d times the area."""
    return drag * v_x * jnp.abs(v_x)


def wheel_outputs(contacts: Wheels, forces: Wheels, omegas: Wheels | None = None) -> dict:
    """The outputs of each wheel, in its own axes: slips, loads, forces and aligning moments; with `omegas` also slip ratios and
    spins."""
    shown = {}
    for name in ("slip_angle", "load") if omegas is None else ("slip_angle", "slip_ratio", "load"):
        shown |= zip(wheel_names(name), (getattr(at, name) for at in contacts), strict=True)
    for name in ("F_x", "F_y", "M_z"):
        shown |= zip(wheel_names(name), (getattr(f, name) for f in forces), strict=True)
    return shown if omegas is None else shown | dict(zip(wheel_names("omega"), omegas, strict=True))


def body_outputs(moves: Motion, a_x: Any, a_y: Any, yaw_acceleration: Any, steers: dict, push: BodyForces) -> dict:
    """The outputs of the body: speeds, accelerations (of an ideal accelerometer), sideslip, speed and course over ground, the
    wheel angles (`steers`, from `steer_outputs`) and the sum of the wheels' forces."""
    return {
        "v_x": moves.v_x,
        "v_y": moves.v_y,
        "yaw": moves.yaw,
        "yaw_rate": moves.yaw_rate,
        "yaw_acceleration": yaw_acceleration,
        "a_x": a_x,
        "a_y": a_y,
        "sideslip": numerics.arctan2(moves.v_y, moves.v_x),
        **over_ground(moves.yaw, moves.v_x, moves.v_y),
        **steers,
        "F_x": push.F_x,
        "F_y": push.F_y,
        "M_z": push.M_z,
    }
