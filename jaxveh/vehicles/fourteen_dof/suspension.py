"""The joints along which the wheels travel, with their springs, dampers and anti-roll bars."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh import numerics
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.fourteen_dof.kinematics import Body
from jaxveh.vehicles.fourteen_dof.parameters import AbstractSuspendedTwoTrack
from jaxveh.vehicles.fourteen_dof.vectors import Vector, add, cross, dot, times
from jaxveh.vehicles.wheels import Wheels, each_wheel, front_rear

LEFT = Wheels(1.0, -1.0, 1.0, -1.0)
"""1 for a wheel on the left, -1 on the right."""


class Joint(NamedTuple):
    """A prismatic joint in the body's axes: the wheel's centre at rest relative to the body's centre of gravity `place` (m), its
    displacement per metre of travel `slope`, the square of that, and the mass of the wheel (kg)."""

    place: Vector
    slope: Vector
    square: Any
    mass: Any


class Wheel(NamedTuple):
    """The centre of a wheel in the body's axes: position (m), velocity (m/s), and the part of its acceleration (m/s^2) that does
    not depend on accelerations of the body or the travel (centripetal and Coriolis)."""

    place: Vector
    velocity: Vector
    bias: Vector


def spring_loads(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The load of each spring at rest, N."""
    half = 0.5 * GRAVITY * car.sprung_mass / (car.front_axle_to_cg + car.rear_axle_to_cg)
    return front_rear(half * car.rear_axle_to_cg, half * car.front_axle_to_cg)


def unsprung(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The unsprung mass of each wheel, kg."""
    return front_rear(car.unsprung_mass_front, car.unsprung_mass_rear)


def static_loads(car: AbstractSuspendedTwoTrack) -> Wheels:
    """Wheel loads at rest on a level road, N."""
    return each_wheel(lambda spring, mass: spring + GRAVITY * mass, spring_loads(car), unsprung(car))


def sunk_at_rest(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The compression of each tyre at rest, m, in the plane of its wheel, which is inclined by the camber."""
    return each_wheel(lambda load, lean: load * lean / car.tyre_stiffness, static_loads(car), leans(car))


def leans(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The cosine of each wheel's camber at rest."""
    return front_rear(numerics.cos(car.camber_front), numerics.cos(car.camber_rear))


def joints(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The joint of each wheel.

    Across the car it is inclined so that the contact point turns about the roll centre: in bump the left wheel moves outwards by
    `2 h_rc / track` per metre of travel. Along the car it is inclined by `pitch_slope`.
    """
    centres = front_rear(car.roll_centre_front, car.roll_centre_rear)
    tracks = front_rear(car.track_front, car.track_rear)
    pitch_slopes = front_rear(car.pitch_slope_front, car.pitch_slope_rear)

    def one(position, side, centre, track, along, mass, sunk, lean):
        x, y = position
        slope = Vector(along, side * 2.0 * centre / track, 1.0)
        return Joint(Vector(x, y, lean * (car.wheel_radius - sunk) - car.cg_height), slope, dot(slope, slope), mass)

    masses, sunk = unsprung(car), sunk_at_rest(car)
    return each_wheel(one, car.places, LEFT, centres, tracks, pitch_slopes, masses, sunk, leans(car))


def wheel_at(joint: Joint, travel: Any, rate: Any, body: Body) -> Wheel:
    """The wheel's centre at a `travel` (m, positive upwards) and its `rate` (m/s)."""
    place = add(joint.place, times(travel, joint.slope))
    along = times(rate, joint.slope)
    carried = cross(body.omega, place)
    bias = cross(body.omega, add(carried, times(2.0, along)))
    return Wheel(place, add(body.velocity, carried, along), bias)


def suspension_forces(car: AbstractSuspendedTwoTrack, travels: Wheels, rates: Wheels) -> tuple[Wheels, Wheels]:
    """The force that pushes each wheel down against its travel (N), and the damper's part of it.

    It is the sum of the spring, preloaded for rest, the damper, and the anti-roll bar, which acts on the difference of the two
    travels of an axle.
    """
    springs, dampers = front_rear(car.spring_front, car.spring_rear), front_rear(car.damper_front, car.damper_rear)
    bars = front_rear(car.anti_roll_front, car.anti_roll_rear)
    other = Wheels(travels.fr, travels.fl, travels.rr, travels.rl)
    damping = each_wheel(lambda damper, rate: damper * rate, dampers, rates)
    force = each_wheel(
        lambda load, k, bar, travel, opposite, damped: load + k * travel + bar * (travel - opposite) + damped,
        spring_loads(car), springs, bars, travels, other, damping,
    )  # fmt: skip
    return force, damping
