"""The equations of motion of a body with four masses on prismatic joints, exact and without an axis of vectors."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh.numerics import solve_scalars
from jaxveh.vehicles.fourteen_dof.suspension import Joint, Wheel
from jaxveh.vehicles.fourteen_dof.vectors import Vector, add, cross, dot, minus, scaled
from jaxveh.vehicles.wheels import Wheels, each


class Inertia(NamedTuple):
    """The sprung mass (kg) and its moments of inertia about its centre of gravity (kg m^2); `xz` is the integral of x z dm."""

    mass: Any
    x: Any
    y: Any
    z: Any
    xz: Any


class Accelerations(NamedTuple):
    """Of the body's centre of gravity (m/s^2) and of its turning (rad/s^2), in its axes; of each wheel's travel (m/s^2)."""

    linear: Vector
    angular: Vector
    travels: Wheels


def accelerations(
    inertia: Inertia,
    joints: Wheels,
    wheels: Wheels,
    omega: Vector,
    spin: Vector,
    force: Vector,
    moment: Vector,
    on_wheels: Wheels,
    suspension: Wheels,
) -> Accelerations:
    """Accelerations of all masses, in the body's axes.

    `force` (N) and `moment` (N m) act on the body at its centre of gravity, gravity included; `on_wheels` (N) on the wheels'
    centres, gravity included; `suspension` (N) along each joint, pushing the wheel down. `spin` is the wheels' angular
    momentum (N m s). With d a joint's slope, r the wheel's place, q = (d, r x d), A the wheel's acceleration and G = F -
    m_u A' without the part of A that is unknown, d'Alembert's principle along the joint takes the travel out:

        |d|^2 m_u zeta'' = d . G - S - m_u d . (a + alpha x r)

    and leaves for the body a symmetric system in (a, alpha), in which each wheel has the inertia of a point mass across its
    joint: m_u (J^T J - q q^T / |d|^2) with J = (1, -[r]x).
    """
    on_wheel = each(_free_force, joints, wheels, on_wheels)
    matrix, b = _body_alone(inertia, omega, spin, force, moment)
    for joint, wheel, G, S in zip(joints, wheels, on_wheel, suspension, strict=True):
        matrix, b = _with_wheel(matrix, b, joint, wheel, G, S)
    found = solve_scalars(matrix, b)
    linear, angular = Vector(*found[:3]), Vector(*found[3:])

    def travel(joint: Joint, wheel: Wheel, G: Vector, S: Any):
        carried = add(linear, cross(angular, wheel.place))
        return (dot(joint.slope, minus(G, scaled(joint.mass, carried))) - S) / (joint.mass * joint.square)

    return Accelerations(linear, angular, each(travel, joints, wheels, on_wheel, suspension))


def _free_force(joint: Joint, wheel: Wheel, force: Vector) -> Vector:
    """Force on a wheel less what its centripetal and Coriolis acceleration needs, N."""
    return minus(force, scaled(joint.mass, wheel.bias))


def _body_alone(inertia: Inertia, omega: Vector, spin: Vector, force: Vector, moment: Vector):
    """Rows of the system up to the diagonal, and its right-hand side, of the body without wheels."""
    I, w = inertia, omega
    turns = Vector(I.x * w.x - I.xz * w.z, I.y * w.y, I.z * w.z - I.xz * w.x)
    rest = minus(moment, cross(w, add(turns, spin)))
    matrix = [
        [I.mass],
        [0.0, I.mass],
        [0.0, 0.0, I.mass],
        [0.0, 0.0, 0.0, I.x],
        [0.0, 0.0, 0.0, 0.0, I.y],
        [0.0, 0.0, 0.0, -I.xz, 0.0, I.z],
    ]
    return matrix, [*force, *rest]


def _with_wheel(matrix: list, b: list, joint: Joint, wheel: Wheel, G: Vector, S: Any):
    """The system with one wheel more."""
    m, r, d = joint.mass, wheel.place, joint.slope
    q = (*d, *cross(r, d))
    share = m / joint.square
    point = [
        [m],
        [0.0, m],
        [0.0, 0.0, m],
        [0.0, -m * r.z, m * r.y, m * (r.y * r.y + r.z * r.z)],
        [m * r.z, 0.0, -m * r.x, -m * r.x * r.y, m * (r.x * r.x + r.z * r.z)],
        [-m * r.y, m * r.x, 0.0, -m * r.x * r.z, -m * r.y * r.z, m * (r.x * r.x + r.y * r.y)],
    ]
    along = (dot(d, G) - S) / joint.square
    rows = [
        [old + new - share * (q[i] * q[j]) for j, (old, new) in enumerate(zip(before, added, strict=True))]
        for i, (before, added) in enumerate(zip(matrix, point, strict=True))
    ]
    right = [old + new - along * e for old, new, e in zip(b, (*G, *cross(r, G)), q, strict=True)]
    return rows, right
