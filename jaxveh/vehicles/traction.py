"""Longitudinal wheel forces directly from the torques, for cars without wheel spin as a state."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.roads import Ground
from jaxveh.tyres import Contact, Forces
from jaxveh.vehicles.drive import AbstractDriven
from jaxveh.vehicles.load_transfer import AbstractShiftingLoads
from jaxveh.vehicles.two_track import OnRoad
from jaxveh.vehicles.wheels import (
    BodyForces,
    Wheels,
    body_forces,
    each_wheel,
    frictions,
    sum_of_wheels,
    travel_direction,
)

LEAST_SHARE = 0.1
"""The share of its lateral force that a wheel keeps at any torque (as in `tyres.Fiala`): F_x is at most `sqrt(1 - 0.1^2)` of the
grip, where the slope of the ellipse is finite."""

_END = (1.0 - LEAST_SHARE**2) ** 0.5
_CORNER = 0.1
"""Half the width of the parabola between the straight line and the limit."""

_LEAST_LIMIT = 1e-6
"""N: the lower bound of the limit in the denominator. So small a limit is that of a lifted wheel, of a model car of 40 g, too."""


def saturate(wish: Any) -> Any:
    """The demand `wish` (-), limited by grip: exact up to 0.895, at most 0.995, with a parabola between, so without a kink."""
    held = jnp.clip(wish, -(_END + _CORNER), _END + _CORNER)
    excess = jnp.maximum(jnp.abs(held) - (_END - _CORNER), 0.0)
    return held - jnp.sign(held) * jnp.square(excess) / (4.0 * _CORNER)


def within_grip(forces: Forces, wish: Any, limit: Any) -> Forces:
    """The `forces` of a tyre at zero slip ratio combined with the demanded longitudinal force `wish` (N) on a friction ellipse.

        F_x = limit s,    F_y = F_y0 sqrt(1 - s^2),    M_z = M_z0 sqrt(1 - s^2),    s = saturated(wish / limit)

    `limit` (N) is the greatest longitudinal force (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., ch. 13.4; the friction
    ellipse of Milliken & Milliken, Race Car Vehicle Dynamics, ch. 2, applied to forces).
    """
    share = saturate(wish / jnp.maximum(limit, _LEAST_LIMIT))
    left = numerics.sqrt(1.0 - jnp.square(share))
    return forces._replace(F_x=limit * share, F_y=left * forces.F_y, M_z=left * forces.M_z)


class AbstractSpinless(AbstractDriven, AbstractShiftingLoads):
    """A car without wheel spin as a state: longitudinal forces are torques over the radius, limited by grip.

    **Parameters** of the grip: `grip` (-), the greatest longitudinal force over load on a road of friction 1.
    """

    _: KW_ONLY
    grip: jax.Array = positive("-", default=1.0)

    @property
    def inputs(self):
        return (*self.steering.inputs, *self.drive.inputs, *self.load_transfer.inputs)

    def steady_a_x(self, x: Any, u: Any, ground: Ground, g: tuple[Any, Any, Any]) -> Any:
        """The a_x, m/s^2, due to the torques, limited by grip. Loads can follow it without any tyre force being computed."""
        drive, brake = self.drive.torques(u)
        push = (sum_of_wheels(drive) - sum_of_wheels(brake) * travel_direction(x.v_x)) / self.wheel_radius
        limit = self.grip * self.mass * (-g[2] * 0.25 * sum_of_wheels(frictions(ground)))
        return limit * saturate(push / jnp.maximum(limit, _LEAST_LIMIT)) / self.mass


def driven_forces(car: AbstractSpinless, forces: Forces, at: Contact, along: Any, drive: Any, brake: Any) -> Forces:
    """The forces of a wheel (or axle) of `car` that rolls at `along` (m/s) under the torques `drive` and `brake` (N m).

    The demanded force is the drive torque less brake torque and rolling resistance, over the radius. The limit is `car.grip`
    times the road's friction and the load.
    """
    load = jnp.maximum(at.load, 0.0)
    slowing = brake + car.rolling_resistance * load * car.wheel_radius
    wish = (drive - slowing * travel_direction(along)) / car.wheel_radius
    return within_grip(forces, wish, car.grip * at.friction * load)


class Driven(NamedTuple):
    """The forces of the road on a driven car: `road` without the torques of motors and brakes, the wheels' `forces` with them,
    and their sum on the body, `push`; `drive`: the motors' torques, N m."""

    road: OnRoad
    forces: Wheels
    push: BodyForces
    drive: Wheels


def drive_over_road(car: AbstractSpinless, x: Any, u: Any, ground: Ground) -> Driven:
    """The forces of the road on a car whose wheel forces are `driven_forces`."""
    drive, brake = car.drive.torques(u)
    road = car.on_road(x, u, ground)
    under = lambda force, at, move, *torques: driven_forces(car, force, at, move.along, *torques)
    forces = each_wheel(under, road.forces, road.contacts, road.moves, drive, brake)
    return Driven(road, forces, body_forces(car.places, road.moves, forces), drive)


def drive_power(car: AbstractSpinless, drive: Wheels, moves: Wheels) -> Any:
    """The power of the driving torques, W, on wheels that roll without slip."""
    return sum_of_wheels(each_wheel(lambda torque, move: torque * move.along, drive, moves)) / car.wheel_radius
