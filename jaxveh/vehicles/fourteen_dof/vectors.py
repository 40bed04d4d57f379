"""Vectors of three named scalars: in a batch the fields are arrays, without an axis of length three."""

from __future__ import annotations

from typing import Any, NamedTuple


class Vector(NamedTuple):
    """The components of a vector along x, y and z."""

    x: Any
    y: Any
    z: Any


def add(first: Vector, *others: Vector) -> Vector:
    """The sum of vectors."""
    for other in others:
        first = Vector(first.x + other.x, first.y + other.y, first.z + other.z)
    return first


def minus(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


def times(factor: Any, a: Vector) -> Vector:
    """`factor` times `a`."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


def dot(a: Vector, b: Vector) -> Any:
    """The inner product of two vectors."""
    return a.x * b.x + a.y * b.y + a.z * b.z


def cross(a: Vector, b: Vector) -> Vector:
    """The cross product a x b in right-handed axes."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
