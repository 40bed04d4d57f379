"""Where a wheel touches the road, how it slides there, and what the road's forces are to the body and to the wheel's spin."""

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
"""Of a tyre's compression the part by which its effective rolling radius shrinks: a belt that hardly stretches."""


def axles(car: AbstractSuspendedTwoTrack, steers: Wheels) -> Wheels:
    """The axis about which each wheel spins, pointing to the left, in the body's axes.

    The wheels turn about the body's z axis by `steers` (rad), and the front ones as far as `ackermann` says by the angle with
    which all wheels would turn about one point on the rear axle's line. Toe is positive inwards, camber where the tops lean out.
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
    """How a wheel stands on the road. Vectors are in the intermediate axes.

    `arm` from its centre to the contact point, `radius` with which it rolls (m), `axis` of its spin, `turns`: the body's
    angular velocity, `moves` (as `wheels.rolling`), and what makes the load: `sinks`, the contact point's speed into the
    road (m/s), and `damped`, the damping's part of the load (N).
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
    sec. 2.2), its speed is that of the wheel's material there. The tyre is compressed along the wheel's plane, so that the
    load, along the road's normal, is by 1 / cos(camber) larger: the potential of the compression then makes it.
    """
    height = body.height + dot(body.axes.up, wheel.place) - road
    speed, turns, axis = (to_road(body.axes, a) for a in (wheel.velocity, body.omega, axis))
    flat = numerics.hypot(axis.x, axis.y)  # the camber's cosine
    cosine, sine = axis.y / flat, -axis.x / flat
    aside = height * axis.z / flat
    arm = Vector(-sine * aside, cosine * aside, -height)
    # The wheel does not turn with the body about its own axis.
    held = minus(turns, times(dot(turns, axis), axis))
    at = add(speed, cross(held, arm))
    compression = jnp.maximum(car.wheel_radius - height / flat, 0.0)
    spring = car.tyre_stiffness * compression / flat
    load = jnp.where(compression > 0, spring - car.tyre_damping * at.z / (flat * flat), 0.0)
    load = jnp.maximum(load, 0.0)
    radius = car.wheel_radius - ROLLING_SHARE * compression
    moves = WheelMotion(at.x * cosine + at.y * sine, at.y * cosine - at.x * sine, cosine, sine)
    camber = numerics.arctan2(axis.z, flat)
    found = contact(moves, load, friction, car.crawl_speed, omega * radius, camber)
    return found, Touch(arm, radius, axis, turns, moves, -at.z, load - spring)


class Reaction(NamedTuple):
    """What the road does through one wheel: force on its centre (N), moment on the body about that (N m; both in the body's
    axes), moment on the wheel about its axis (N m), and the power that it takes from the car (W)."""

    force: Vector
    moment: Vector
    spin: Any
    dissipation: Any


@numerics.fence_results
def reaction(
    car: AbstractSuspendedTwoTrack, body: Body, at: Contact, how: Touch, forces: Forces, omega: Any
) -> Reaction:
    """The road's forces on body and wheel.

    The longitudinal force turns the wheel with the arm of the *rolling* radius. With the loaded radius, which is smaller,
    a driven tyre would give more power to the car (F_x r_e omega) than it takes from the shaft (F_x r_l omega). The
    difference, F_x (r_e - r_l), is a moment of the road: the load's centre moves forward under a driving force.
    """
    moves, axis = how.moves, how.axis
    c, s = moves.cosine, moves.sine
    # Tyres know no direction of travel: their rolling resistance is that of rolling forwards.
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
