"""The exact equations of motion of a body with four masses on prismatic joints, written with named scalars."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh.numerics import fence_results, solve_scalars
from jaxveh.vehicles.fourteen_dof.suspension import Joint, Wheel
from jaxveh.vehicles.fourteen_dof.vectors import Vector, add, cross, dot, minus, times
from jaxveh.vehicles.wheels import Wheels, each_wheel, sum_of_wheels


class Inertia(NamedTuple):
    """The sprung mass (kg) and its moments of inertia about its centre of gravity (kg m^2); `xz` is the integral of x z dm."""

    mass: Any
    x: Any
    y: Any
    z: Any
    xz: Any


class Accelerations(NamedTuple):
    """The accelerations of the body's centre of gravity (m/s^2) and of its rotation (rad/s^2), in its axes, and those of the
    wheels' travels (m/s^2)."""

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
    """The accelerations of all masses, in the body's axes.

    `force` (N) and `moment` (N m) act on the body at its centre of gravity, `on_wheels` (N) on the wheels' centres, all including
    gravity. `suspension` (N) acts along each joint and pushes the wheel down. `spin` is the wheels' angular momentum (N m s).
    With d the slope of a joint, r the position of its wheel, q = (d, r x d), and G = F - m_u A', where A' is the known part of
    the wheel's acceleration, d'Alembert's principle along the joint eliminates the travel zeta:

        |d|^2 m_u zeta'' = d . G - S - m_u d . (a + alpha x r)

    For the body this leaves a symmetric system in (a, alpha), in which each wheel has the inertia of a point mass across its
    joint: m_u (J^T J - q q^T / |d|^2) with J = (1, -[r]x).
    """
    on_wheel = each_wheel(lambda joint, wheel, F: minus(F, times(joint.mass, wheel.bias)), joints, wheels, on_wheels)
    ways = each_wheel(lambda joint, wheel: (*joint.slope, *cross(wheel.place, joint.slope)), joints, wheels)
    matrix = _matrix(inertia, joints, wheels, ways)
    b = _right_side(inertia, joints, wheels, ways, omega, spin, force, moment, on_wheel, suspension)
    linear, angular = _solve(matrix, b)

    def travel(joint: Joint, wheel: Wheel, G: Vector, S: Any):
        carried = add(linear, cross(angular, wheel.place))
        return (dot(joint.slope, minus(G, times(joint.mass, carried))) - S) / (joint.mass * joint.square)

    return Accelerations(linear, angular, each_wheel(travel, joints, wheels, on_wheel, suspension))


@fence_results
def _solve(matrix: list, b: list) -> tuple[Vector, Vector]:
    """The accelerations a and alpha of the body."""
    found = solve_scalars(matrix, b)
    return Vector(*found[:3]), Vector(*found[3:])


@fence_results
def _matrix(inertia: Inertia, joints: Wheels, wheels: Wheels, ways: Wheels) -> list:
    """The lower triangle of the system in (a, alpha): that of one rigid body less the inertia along the free joints."""
    m = each_wheel(lambda joint: joint.mass, joints)
    moment = each_wheel(lambda mass, wheel: times(mass, wheel.place), m, wheels)
    s = add(*moment)
    second = lambda a, b: sum_of_wheels(
        each_wheel(lambda f, wheel: getattr(f, a) * getattr(wheel.place, b), moment, wheels)
    )
    xx, yy, zz = second("x", "x"), second("y", "y"), second("z", "z")
    xy, xz, yz = second("x", "y"), second("x", "z"), second("y", "z")
    mass = inertia.mass + sum_of_wheels(m)
    rigid = [
        [mass],
        [0.0, mass],
        [0.0, 0.0, mass],
        [0.0, -s.z, s.y, inertia.x + (yy + zz)],
        [s.z, 0.0, -s.x, -xy, inertia.y + (xx + zz)],
        [-s.y, s.x, 0.0, -inertia.xz - xz, -yz, inertia.z + (xx + yy)],
    ]
    shares = each_wheel(lambda joint, q: [joint.mass / joint.square * e for e in q], joints, ways)
    free = lambda i, j: sum_of_wheels(each_wheel(lambda share, q: share[i] * q[j], shares, ways))
    return [[entry - free(i, j) for j, entry in enumerate(row)] for i, row in enumerate(rigid)]


@fence_results
def _right_side(inertia, joints, wheels, ways, omega, spin, force, moment, on_wheel, suspension) -> list:
    """The forces and moments on one rigid body of all masses, less the part along the free joints."""
    I, w = inertia, omega
    turns = Vector(I.x * w.x - I.xz * w.z, I.y * w.y, I.z * w.z - I.xz * w.x)
    rest = minus(moment, cross(w, add(turns, spin)))
    levers = each_wheel(lambda wheel, G: cross(wheel.place, G), wheels, on_wheel)
    along = each_wheel(lambda joint, G, S: (dot(joint.slope, G) - S) / joint.square, joints, on_wheel, suspension)
    right = [*add(force, *on_wheel), *add(rest, *levers)]
    return [entry - sum_of_wheels(each_wheel(lambda l, q: l * q[i], along, ways)) for i, entry in enumerate(right)]  # noqa: B023
