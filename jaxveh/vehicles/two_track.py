"""What all cars on four wheels have in common: parameters, tyres, units, and the outputs that they offer."""

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
"""Units of what two-track cars have as states, inputs and outputs."""


class AbstractTwoTrack(AbstractOnTyres):
    """A car on four wheels.

    **Parameters** of the four wheels: `track_front`, `track_rear` (m, between the wheels' middles), `mirrored`: the tyres of the
    right wheels are the mirror images of the left ones' (so by default), `cg_height` (m, over the road).
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
        """(x, y), m, of the wheels from the centre of gravity."""
        return corners(self.front_axle_to_cg, self.rear_axle_to_cg, self.track_front, self.track_rear)


class OnRoad(NamedTuple):
    """How a car's wheels are turned (rad), touch the road and move over it, what the road does to them in their axes, and the
    rates of dynamic tyres' states."""

    steers: Wheels
    contacts: Wheels
    moves: Wheels
    forces: Wheels
    tyre_rates: tuple


class AbstractLoadedTwoTrack(AbstractTwoTrack, AbstractShiftingLoads):
    """A two-track car whose wheels keep to the road: their loads follow from the accelerations that `load_transfer` feels.

    Its kinds say what these accelerations are in a steady turn, and how the loads follow.
    """

    body_states: eqx.AbstractClassVar[tuple[str, ...]]
    """Names of the body's and the wheels' states."""

    @property
    def own_states(self):
        return (*self.body_states, *self.load_transfer.state_names)

    def told_or_own_speed(self, x: Any, u: Any) -> Any:
        """Forward speed, m/s: a state, or given."""
        return x.v_x if "v_x" in self.body_states else u.v_x

    @abc.abstractmethod
    def wheel_speed(self, x: Any, u: Any) -> Any:
        """Forward speed, m/s, of the point from which the wheels' places are told."""

    @abc.abstractmethod
    def steady_a_x(self, x: Any, u: Any, ground: Ground, g: tuple[Any, Any, Any]) -> Any:
        """Longitudinal acceleration, m/s^2, that can be told without knowing a tyre's force, under gravity g (m/s^2)."""

    @abc.abstractmethod
    def loads(self, x: Any, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
        """Wheel loads, N, under felt accelerations a_x, a_y and gravity g_z across the road (m/s^2)."""

    def rim_speeds(self, x: Any) -> Wheels:
        """`omega r_e` of each wheel, m/s; None where wheels have no spin of their own."""
        del x
        return Wheels(None, None, None, None)

    def contacts(self, x, u, ground: Ground = LEVEL) -> Wheels:
        return self._stand(x, u, ground)[1]

    def on_road(self, x: Any, u: Any, ground: Ground) -> OnRoad:
        """What the road does to the wheels."""
        steers, contacts, moves = self._stand(x, u, ground)
        tyres = self.tyres
        states = tyres.states(x)
        return OnRoad(steers, contacts, moves, tyres.forces(contacts, states), tyres.rates(contacts, states))

    def _stand(self, x, u, ground: Ground) -> tuple[Wheels, Wheels, Wheels]:
        """Angles, contacts and motions of the wheels."""
        steers = self.steering.angles(self, u, self.told_or_own_speed(x, u))
        moves = rolling_wheels(self.places, self.wheel_speed(x, u), x.v_y, x.yaw_rate, steers)
        g = _, g_y, g_z = gravity(ground)
        steady = self.steady_a_x(x, u, ground, g), self.told_or_own_speed(x, u) * x.yaw_rate - g_y
        loads = self.loads(x, *self.load_transfer.felt_accelerations(x, u, steady), g_z)
        touching = lambda move, load, mu, speed: contact(move, load, mu, self.crawl_speed, speed)
        return steers, each_wheel(touching, moves, loads, frictions(ground), self.rim_speeds(x)), moves


def rolling_wheels(places: Wheels, v_x: Any, v_y: Any, yaw_rate: Any, steers: Wheels) -> Wheels:
    """How wheels at `places` ((x, y), m) that are turned by `steers` (rad) move over the road."""
    return each_wheel(lambda at, one: rolling(at, v_x, v_y, yaw_rate, *one), places, directions(steers))


def directions(steers: Wheels) -> Wheels:
    """(cosine, sine) of each wheel's angle, once for wheels that share it; (1.0, 0.0) of one that is never steered."""
    found = {id(angle): (1.0, 0.0) if is_straight(angle) else _cosine_and_sine(angle) for angle in steers}
    return each_wheel(lambda angle: found[id(angle)], steers)


@numerics.fence_results
def _cosine_and_sine(steer: Any) -> tuple[Any, Any]:
    return numerics.cos(steer), numerics.sin(steer)


def air_drag(drag: Any, v_x: Any) -> Any:
    """Drag of the air against the motion, N: `drag` (N s^2/m^2) is half the air's density times c_d times the area."""
    return drag * v_x * jnp.abs(v_x)


def wheel_outputs(contacts: Wheels, forces: Wheels, omegas: Wheels | None = None) -> dict:
    """What each wheel says, in its own axes: slips, loads, forces, aligning moments, spins; without `omegas` no slip ratio."""
    shown = {}
    for name in ("slip_angle", "load") if omegas is None else ("slip_angle", "slip_ratio", "load"):
        shown |= zip(wheel_names(name), (getattr(at, name) for at in contacts), strict=True)
    for name in ("F_x", "F_y", "M_z"):
        shown |= zip(wheel_names(name), (getattr(f, name) for f in forces), strict=True)
    return shown if omegas is None else shown | dict(zip(wheel_names("omega"), omegas, strict=True))


def body_outputs(moves: Motion, a_x: Any, a_y: Any, yaw_acceleration: Any, steers: dict, push: BodyForces) -> dict:
    """What the body says: speeds, accelerations (of an ideal accelerometer), sideslip, speed and course over ground, how the
    wheels are turned (`steers`: `steer_outputs`), and their forces on it."""
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
