"""Motion of a point of the car's body: angular rates, specific force and velocity away from the centre of gravity.

Vectors are tuples (x, y, z). The intermediate axes (road-parallel), turned by `pitch` about y and then by `roll` about
x, are the body's axes (ISO 8855): roll positive with the left side up, pitch positive with the nose down.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.vehicles import GRAVITY

Vector = tuple[Any, Any, Any]

POSES = ("roll", "pitch", "roll_rate", "pitch_rate")
"""The outputs for roll and pitch of the body; taken as zero if a car does not have them."""


INERTIAL = ("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate")
"""The channels of accelerometers and gyroscopes, in this order."""


def into_axes(v: Vector, roll: Any, pitch: Any, yaw: Any = None) -> Vector:
    """The vector in axes turned by yaw about z, then pitch about y, then roll about x."""
    x, y, z = v
    if yaw is not None:
        c, s = numerics.cos(yaw), numerics.sin(yaw)
        x, y = c * x + s * y, c * y - s * x
    c, s = numerics.cos(pitch), numerics.sin(pitch)
    x, z = c * x - s * z, c * z + s * x
    c, s = numerics.cos(roll), numerics.sin(roll)
    return x, c * y + s * z, c * z - s * y


def out_of_axes(v: Vector, roll: Any, pitch: Any) -> Vector:
    """The inverse of `into_axes` for pitch and roll: a vector of the turned axes in the axes before the turns."""
    x, y, z = v
    c, s = numerics.cos(roll), numerics.sin(roll)
    y, z = c * y - s * z, c * z + s * y
    c, s = numerics.cos(pitch), numerics.sin(pitch)
    return c * x + s * z, y, c * z - s * x


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def add(*vectors: Vector) -> Vector:
    """The sum of vectors."""
    x, y, z = (sum(parts[1:], parts[0]) for parts in zip(*vectors, strict=True))
    return x, y, z


def of_angles(roll, pitch, roll_rate, pitch_rate, yaw_rate) -> Vector:
    """The body's angular velocity in its own axes, from the rates of yaw, pitch and roll."""
    zero = jnp.zeros_like(yaw_rate)
    _, about_y, about_z = into_axes((zero, pitch_rate, zero), roll, zero)
    turn = into_axes((zero, zero, yaw_rate), roll, pitch)
    return add((roll_rate, about_y, about_z), turn)


def rotation(outputs: Mapping[str, jax.Array]) -> tuple[Vector, Vector]:
    """The body's angular velocity and acceleration in its own axes; the acceleration is the exact derivative of the velocity."""
    at = lambda name: outputs.get(name, jnp.zeros_like(outputs["yaw_rate"]))
    values = (*(at(name) for name in POSES), outputs["yaw_rate"])
    rates = (at("roll_rate"), at("pitch_rate"), at("roll_acceleration"), at("pitch_acceleration"))
    return jax.jvp(of_angles, values, (*rates, outputs["yaw_acceleration"]))


def specific_force(outputs: Mapping[str, jax.Array], position: Any, rates: Vector, accelerations: Vector) -> Vector:
    """The specific force (m/s^2) in the body's axes at `position` (m from the centre of gravity, body axes).

    It is `f + alpha x r + omega x (omega x r)`. For a car without `a_z`, this is the gravity normal to the road.
    """
    roll, pitch = (outputs.get(name, jnp.zeros_like(outputs["a_x"])) for name in POSES[:2])
    force = outputs["a_x"], outputs["a_y"], outputs["a_z"] if "a_z" in outputs else _normal_gravity(outputs)
    r = (position.x, position.y, position.z)
    return add(into_axes(force, roll, pitch), cross(accelerations, r), cross(rates, cross(rates, r)))


def inertial(outputs: Mapping[str, jax.Array], position: Any) -> dict[str, jax.Array]:
    """The measurements of ideal accelerometers (m/s^2) and gyroscopes (rad/s) at `position` on the body, by channel
    (`INERTIAL`)."""
    rates, accelerations = rotation(outputs)
    force = specific_force(outputs, position, rates, accelerations)
    return dict(zip(INERTIAL, (*force, *rates), strict=True))


def velocity(outputs: Mapping[str, jax.Array], position: Any) -> tuple[Any, Any]:
    """The velocity of a point of the body in the intermediate axes, m/s: forward and to the left."""
    roll, pitch, roll_rate, pitch_rate = (outputs.get(name, jnp.zeros_like(outputs["v_x"])) for name in POSES)
    rates = of_angles(roll, pitch, roll_rate, pitch_rate, outputs["yaw_rate"])
    r = (position.x, position.y, position.z)
    x, y, _ = out_of_axes(cross(rates, r), roll, pitch)
    return outputs["v_x"] + x, outputs["v_y"] + y


def rise(outputs: Mapping[str, jax.Array]) -> jax.Array:
    """The vertical speed of a car that follows its road, m/s, positive upwards."""
    along, across = (numerics.tan(outputs.get(name, jnp.zeros_like(outputs["v_x"]))) for name in ("grade", "bank"))
    run = numerics.sqrt(1.0 + along * along)
    # The axes in the road's plane are those of gravity's components: x in the vertical plane of the car's heading, y
    # perpendicular to it.
    return (outputs["v_x"] * along + outputs["v_y"] * across / numerics.sqrt(run * run + across * across)) / run


def _normal_gravity(outputs: Mapping[str, jax.Array]) -> jax.Array:
    """The component of gravity normal to a road with the slopes tan(grade) and tan(bank), positive."""
    zero = jnp.zeros_like(outputs["a_x"])
    along, across = (numerics.tan(outputs.get(name, zero)) for name in ("grade", "bank"))
    return GRAVITY / numerics.sqrt(1 + along * along + across * across)
