"""The joints on which the wheels travel, and the springs, dampers and anti-roll bars along them."""

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
    """A prismatic joint, in the body's axes from its centre of gravity: the wheel's centre at rest `place` (m), the way
    it goes per metre of travel `slope`, its square; and the mass that it carries (kg)."""

    place: Vector
    slope: Vector
    square: Any
    mass: Any


class Wheel(NamedTuple):
    """A wheel's centre in the body's axes: place (m), velocity (m/s), and acceleration (m/s^2) as far as no acceleration of
    the body or along the joint makes it (centripetal and Coriolis)."""

    place: Vector
    velocity: Vector
    bias: Vector


def spring_loads(car: AbstractSuspendedTwoTrack) -> Wheels:
    """What each spring carries at rest, N."""
    half = 0.5 * GRAVITY * car.sprung_mass / (car.front_axle_to_cg + car.rear_axle_to_cg)
    return front_rear(half * car.rear_axle_to_cg, half * car.front_axle_to_cg)


def unsprung(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The mass that each wheel carries with it, kg."""
    return front_rear(car.unsprung_mass_front, car.unsprung_mass_rear)


def static_loads(car: AbstractSuspendedTwoTrack) -> Wheels:
    """Wheel loads at rest on a level road, N."""
    return each_wheel(lambda spring, mass: spring + GRAVITY * mass, spring_loads(car), unsprung(car))


def sunk_at_rest(car: AbstractSuspendedTwoTrack) -> Wheels:
    """By how much each tyre is compressed at rest, m, in the plane of its wheel, which camber inclines."""
    return each_wheel(lambda load, lean: load * lean / car.tyre_stiffness, static_loads(car), leans(car))


def leans(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The cosine of each wheel's camber at rest."""
    return front_rear(numerics.cos(car.camber_front), numerics.cos(car.camber_rear))


def joints(car: AbstractSuspendedTwoTrack) -> Wheels:
    """The joint of each wheel.

    Across the car it is inclined so that the contact point turns about the roll centre: the left wheel moves outwards in
    bump by `2 h_rc / track`. Along, by `pitch_slope`.
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
    """The wheel's centre at a travel (m, up is positive) and its rate (m/s)."""
    place = add(joint.place, times(travel, joint.slope))
    along = times(rate, joint.slope)
    carried = cross(body.omega, place)
    bias = cross(body.omega, add(carried, times(2.0, along)))
    return Wheel(place, add(body.velocity, carried, along), bias)


def suspension_forces(car: AbstractSuspendedTwoTrack, travels: Wheels, rates: Wheels) -> tuple[Wheels, Wheels]:
    """Force that pushes each wheel down against its travel (N), and the part of it that the damper makes.

    Spring, preloaded for rest, damper, and the anti-roll bar on the difference of an axle's travels.
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
