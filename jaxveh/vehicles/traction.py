"""Longitudinal wheel forces straight from the torques, for cars whose wheels have no spin of their own."""

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
"""The share of its lateral force that a wheel keeps however large the torque (as `tyres.Fiala` does): F_x ends at
`sqrt(1 - 0.1^2)` of the grip, where the ellipse's slope is finite."""

_END = (1.0 - LEAST_SHARE**2) ** 0.5
_CORNER = 0.1
"""Half the width of the parabola that joins the straight line and the end."""

_LEAST_LIMIT = 1.0
"""N: so little load cannot be told from a wheel that has lifted, and a division by it is safe."""


def saturate(wish: Any) -> Any:
    """`wish` (-) as far as grip allows: exact up to 0.895, at most 0.995, and a parabola between, without a kink."""
    held = jnp.clip(wish, -(_END + _CORNER), _END + _CORNER)
    excess = jnp.maximum(jnp.abs(held) - (_END - _CORNER), 0.0)
    return held - jnp.sign(held) * jnp.square(excess) / (4.0 * _CORNER)


def within_grip(forces: Forces, wish: Any, limit: Any) -> Forces:
    """Forces of a tyre at no slip ratio, with the torque's force `wish` (N) in their `F_x`, as an ellipse allows.

        F_x = limit s,    F_y = F_y0 sqrt(1 - s^2),    M_z = M_z0 sqrt(1 - s^2),    s = saturated(wish / limit)

    `limit` (N) is the greatest longitudinal force (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., ch. 13.4; the friction
    ellipse of Milliken & Milliken, Race Car Vehicle Dynamics, ch. 2, on forces).
    """
    share = saturate(wish / jnp.maximum(limit, _LEAST_LIMIT))
    left = numerics.sqrt(1.0 - jnp.square(share))
    return forces._replace(F_x=limit * share, F_y=left * forces.F_y, M_z=left * forces.M_z)


class AbstractSpinless(AbstractDriven, AbstractShiftingLoads):
    """A car whose wheels have no spin of their own: torques over the radius are forces, as far as grip allows.

    **Parameters** of the grip: `grip` (-), the greatest longitudinal force over load, times the road's friction.
    """

    _: KW_ONLY
    grip: jax.Array = positive("-", default=1.0)

    @property
    def inputs(self):
        return (*self.steering.inputs, *self.drive.inputs, *self.load_transfer.inputs)

    def steady_a_x(self, x: Any, u: Any, ground: Ground, g: tuple[Any, Any, Any]) -> Any:
        """a_x, m/s^2, that the torques make, as far as grip allows: what loads can follow without knowing a force."""
        drive, brake = self.drive.torques(u)
        push = (sum_of_wheels(drive) - sum_of_wheels(brake) * travel_direction(x.v_x)) / self.wheel_radius
        limit = self.grip * self.mass * (-g[2] * 0.25 * sum_of_wheels(frictions(ground)))
        return limit * saturate(push / jnp.maximum(limit, _LEAST_LIMIT)) / self.mass


def driven_forces(car: AbstractSpinless, forces: Forces, at: Contact, along: Any, drive: Any, brake: Any) -> Forces:
    """Forces of a wheel (or axle) of `car` under its torques (N m), where it rolls at `along` (m/s).

    The torque less brake and rolling resistance, over the radius, is what the wheel asks of the road; `car.grip` times the
    road's friction and the load is the most it gets.
    """
    load = jnp.maximum(at.load, 0.0)
    slowing = brake + car.rolling_resistance * load * car.wheel_radius
    wish = (drive - slowing * travel_direction(along)) / car.wheel_radius
    return within_grip(forces, wish, car.grip * at.friction * load)


class Driven(NamedTuple):
    """What the road does under the torques of motors and brakes: to the wheels, `road` before them and `forces` under them, and
    to the body, `push`; `drive`: the motors' torques, N m."""

    road: OnRoad
    forces: Wheels
    push: BodyForces
    drive: Wheels


def drive_over_road(car: AbstractSpinless, x: Any, u: Any, ground: Ground) -> Driven:
    """How the road carries a car whose wheels' forces are `driven_forces`."""
    drive, brake = car.drive.torques(u)
    road = car.on_road(x, u, ground)
    under = lambda force, at, move, *torques: driven_forces(car, force, at, move.along, *torques)
    forces = each_wheel(under, road.forces, road.contacts, road.moves, drive, brake)
    return Driven(road, forces, body_forces(car.places, road.moves, forces), drive)


def drive_power(car: AbstractSpinless, drive: Wheels, moves: Wheels) -> Any:
    """Power of the driving torques, W, on wheels that roll without slip."""
    return sum_of_wheels(each_wheel(lambda torque, move: torque * move.along, drive, moves)) / car.wheel_radius
