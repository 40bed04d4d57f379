"""The contact point of a wheel, its sliding, and the effect of the road's forces on the body and on the wheel's spin."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres import Contact, Forces
from jaxveh.vehicles.fourteen_dof.kinematics import Body, to_body, to_road
from jaxveh.vehicles.fourteen_dof.parameters import AbstractSuspendedTwoTrack
from jaxveh.vehicles.fourteen_dof.suspension import LEFT, Wheel
from jaxveh.vehicles.fourteen_dof.vectors import Vector, add, cross, dot, minus, times
from jaxveh.vehicles.steering import about_one_point
from jaxveh.vehicles.wheels import WheelMotion, Wheels, contact, each_wheel, front_rear, travel_direction

ROLLING_SHARE = 1.0 / 3.0
"""The decrease of a tyre's effective rolling radius over its compression: the belt hardly stretches."""


def axles(car: AbstractSuspendedTwoTrack, steers: Wheels) -> Wheels:
    """The spin axis of each wheel, pointing to the left, in the body's axes.

    The wheels are turned about the body's z axis by `steers` (rad). The parameter `ackermann` changes the angles of the front
    wheels towards those with which all axes meet in one point on the line of the rear axle. Toe is positive inwards, camber is
    positive with the tops outwards.
    """
    length, half = car.front_axle_to_cg + car.rear_axle_to_cg, 0.5 * car.track_front

    def one(side, angle, toe, camber):
        angle, lean = angle - side * toe, numerics.cos(camber)
        return Vector(-lean * numerics.sin(angle), lean * numerics.cos(angle), -side * numerics.sin(camber))

    fl, fr = about_one_point(steers.fl, steers.fr, car.ackermann, length, half)
    return each_wheel(
        one,
        LEFT,
        Wheels(fl, fr, steers.rl, steers.rr),
        front_rear(car.toe_front, car.toe_rear),
        front_rear(car.camber_front, car.camber_rear),
    )


class Touch(NamedTuple):
    """The contact of a wheel with the road in detail. Vectors are in the intermediate axes.

    `arm`: from the wheel's centre to the contact point (m); `radius`: the rolling radius (m); `axis`: the spin axis; `turns`:
    the body's angular velocity; `moves`: the motion as of `wheels.rolling`; `sinks`: the speed of the contact point into the
    road (m/s); `damped`: the load less that of the tyre's spring (N).
    """

    arm: Vector
    radius: Any
    axis: Vector
    turns: Vector
    moves: WheelMotion
    sinks: Any
    damped: Any


def touch(
    car: AbstractSuspendedTwoTrack, body: Body, wheel: Wheel, axis: Vector, omega: Any, friction: Any, road: Any
) -> tuple[Contact, Touch]:
    """The contact of a wheel that spins with `omega` (rad/s) about `axis` (body's axes), where the road is `road` m high.

    The contact point lies below the centre in the wheel's plane (ISO 8855; H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed.,
    sec. 2.2). Its speed is that of the wheel without its own spin. The tyre is compressed along the wheel's plane; the load,
    along the road's normal, is larger by 1 / cos(camber), so that it derives from the potential of the compression.
    """
    height = body.height + dot(body.axes.up, wheel.place) - road
    speed, turns, axis = (to_road(body.axes, a) for a in (wheel.velocity, body.omega, axis))
    flat = numerics.hypot(axis.x, axis.y)  # the camber's cosine
    cosine, sine = axis.y / flat, -axis.x / flat
    aside = height * axis.z / flat
    arm = Vector(-sine * aside, cosine * aside, -height)
    # The wheel does not turn with the body about its own spin axis.
    held = minus(turns, times(dot(turns, axis), axis))
    at = add(speed, cross(held, arm))
    compression = jnp.maximum(car.wheel_radius - height / flat, 0.0)
    spring = car.tyre_stiffness * compression / flat
    load = jnp.where(compression > 0, spring - car.tyre_damping * at.z / (flat * flat), 0.0)
    load = jnp.maximum(load, 0.0)
    radius = car.wheel_radius - ROLLING_SHARE * compression
    moves = WheelMotion(at.x * cosine + at.y * sine, at.y * cosine - at.x * sine, cosine, sine)
    camber = numerics.arctan2(axis.z, flat)
    found = contact(moves, load, friction, car.slip_floor, omega * radius, camber)
    return found, Touch(arm, radius, axis, turns, moves, -at.z, load - spring)


class Reaction(NamedTuple):
    """The effect of the road through one wheel: the force on its centre (N) and the moment on the body about its centre (N m),
    both in the body's axes, the moment on the wheel about its axis (N m), and the power taken from the car (W)."""

    force: Vector
    moment: Vector
    spin: Any
    dissipation: Any


@numerics.fence_results
def reaction(
    car: AbstractSuspendedTwoTrack, body: Body, at: Contact, how: Touch, forces: Forces, omega: Any
) -> Reaction:
    """The road's forces on body and wheel.

    The longitudinal force acts on the wheel's spin with the arm of the *rolling* radius. With the loaded radius, which is
    smaller, a driven tyre would give more power to the car (F_x r_e omega) than it takes from the shaft (F_x r_l omega). The
    difference F_x (r_e - r_l) is a moment of the road: the centre of the load moves forward under a driving force.
    """
    moves, axis = how.moves, how.axis
    c, s = moves.cosine, moves.sine
    # The rolling resistance of a tyre law is that of forward travel; its sign is set here.
    rolling_moment = forces.M_y * travel_direction(moves.along)
    push = Vector(forces.F_x * c - forces.F_y * s, forces.F_x * s + forces.F_y * c, at.load)
    own = Vector(forces.M_x * c - rolling_moment * s, forces.M_x * s + rolling_moment * c, forces.M_z)
    whole = add(own, cross(how.arm, push))
    on_body = minus(whole, times(dot(whole, axis), axis))
    resisting = car.rolling_resistance * at.load * how.radius * travel_direction(omega * how.radius)
    turning = dot(own, axis) - resisting
    own_on_body = minus(own, times(dot(own, axis), axis))
    taken = (
        forces.F_x * (how.radius * omega - moves.along) - forces.F_y * moves.across
        - dot(own_on_body, how.turns) - turning * omega + how.damped * how.sinks
    )  # fmt: skip
    return Reaction(to_body(body.axes, push), to_body(body.axes, on_body), turning - how.radius * forces.F_x, taken)
