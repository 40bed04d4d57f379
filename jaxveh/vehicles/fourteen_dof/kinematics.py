"""Attitude and rotation of the body: roll, pitch and yaw, and the axes fixed in the body."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh import numerics
from jaxveh.vehicles.fourteen_dof.vectors import Vector, add, cross, dot, minus, times


class Attitude(NamedTuple):
    """The intermediate axes (x, y in the road's plane, z its normal, turned by the yaw), expressed in the body's axes.

    The body is turned from them by the pitch about y, then by the roll about its own x (yaw-pitch-roll of ISO 8855: pitch is
    positive nose down, roll is positive left side up).
    """

    forward: Vector
    left: Vector
    up: Vector


def attitude(roll: Any, pitch: Any) -> Attitude:
    """The attitude at roll and pitch, rad."""
    s_r, c_r = numerics.sin(roll), numerics.cos(roll)
    s_p, c_p = numerics.sin(pitch), numerics.cos(pitch)
    return Attitude(
        forward=Vector(c_p, s_p * s_r, s_p * c_r),
        left=Vector(0.0, c_r, -s_r),
        up=Vector(-s_p, c_p * s_r, c_p * c_r),
    )


def to_road(axes: Attitude, a: Vector) -> Vector:
    """A vector given in the body's axes, expressed in the intermediate axes."""
    return Vector(dot(axes.forward, a), dot(axes.left, a), dot(axes.up, a))


def to_body(axes: Attitude, a: Vector) -> Vector:
    """A vector given in the intermediate axes, expressed in the body's axes."""
    return add(times(a.x, axes.forward), times(a.y, axes.left), times(a.z, axes.up))


def angular_velocity(axes: Attitude, roll_rate: Any, pitch_rate: Any, yaw_rate: Any) -> Vector:
    """The body's angular velocity, rad/s, in its own axes: roll about its x, pitch about `left`, yaw about `up`."""
    across = add(times(pitch_rate, axes.left), times(yaw_rate, axes.up))
    return across._replace(x=roll_rate + across.x)


def angle_accelerations(axes: Attitude, x: Any, omega: Vector, alpha: Vector) -> tuple[Any, Any, Any]:
    """The second derivatives of roll, pitch and yaw, rad/s^2, of a body with the angular acceleration `alpha` (body's axes).

    `left` rotates only with the yaw and `up` not at all. In the body's axes they therefore rotate with the difference of that
    rotation and `omega`.
    """
    moves_left = cross(minus(times(x.yaw_rate, axes.up), omega), axes.left)
    moves_up = cross(axes.up, omega)
    rest = minus(alpha, add(times(x.pitch_rate, moves_left), times(x.yaw_rate, moves_up)))
    up = axes.up
    yaw = (up.y * rest.y + up.z * rest.z) / (up.y * up.y + up.z * up.z)
    return rest.x - yaw * up.x, dot(axes.left, rest), yaw


class Body(NamedTuple):
    """The motion of the body: its attitude, the height of its centre of gravity over the road (m), and in its own axes the
    velocity of that point (m/s) and the angular velocity (rad/s)."""

    axes: Attitude
    height: Any
    velocity: Vector
    omega: Vector


@numerics.fence_results
def body_of(x: Any) -> Body:
    """The motion of the body from the state of the car."""
    axes = attitude(x.roll, x.pitch)
    velocity = to_body(axes, Vector(x.v_x, x.v_y, x.v_z))
    return Body(axes, x.z, velocity, angular_velocity(axes, x.roll_rate, x.pitch_rate, x.yaw_rate))
