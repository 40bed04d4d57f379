"""Vectors of three named scalars: a batch has arrays in the fields, and no axis of length three."""

from __future__ import annotations

from typing import Any, NamedTuple


class Vector(NamedTuple):
    """Components along x, y and z of whatever axes it is said to be in."""

    x: Any
    y: Any
    z: Any


def add(first: Vector, *others: Vector) -> Vector:
    """The sum."""
    for other in others:
        first = Vector(first.x + other.x, first.y + other.y, first.z + other.z)
    return first


def minus(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


def times(factor: Any, a: Vector) -> Vector:
    """`factor` times a."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


def dot(a: Vector, b: Vector) -> Any:
    """The inner product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


def cross(a: Vector, b: Vector) -> Vector:
    """a x b, in axes that are right-handed."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
