"""Families of the package, by what each room lists as public: who belongs to one, and who is inside a value."""

import dataclasses
import inspect

import diffrax

import jaxveh

EXPLICIT_SOLVERS = tuple(
    one
    for one in vars(diffrax).values()
    if isinstance(one, type) and issubclass(one, diffrax.AbstractERK | diffrax.Euler) and one is not diffrax.AbstractERK
)
"""The explicit solvers that diffrax has, of one right side and without a step before the first."""


def members(room, base):
    """Names of a room's public classes that are of a kind and can be made."""
    listed = {name: getattr(getattr(jaxveh, room), name) for name in getattr(jaxveh, room).__all__}
    return {
        name
        for name, one in listed.items()
        if inspect.isclass(one) and issubclass(one, base) and not inspect.isabstract(one)
    }


def kinds_in(value, base):
    """Names of the classes of a kind that a value is or has inside, in fields, tuples and mappings."""
    found = {type(value).__name__} if isinstance(value, base) else set()
    if dataclasses.is_dataclass(value) and not inspect.isclass(value):
        inside = [getattr(value, field.name, None) for field in dataclasses.fields(value)]
    elif isinstance(value, dict):
        inside = list(value.values())
    elif isinstance(value, tuple | list):
        inside = list(value)
    else:
        inside = []
    return found.union(*(kinds_in(one, base) for one in inside))


def left_out(room, base, values, exempt):
    """Members of a family that none of the `values` is or has inside, and that are not `exempt` (a reason each); and exempt ones
    that are none, or are there all the same."""
    there = set().union(*(kinds_in(value, base) for value in values))
    wanted = members(room, base)
    return sorted((wanted - there - set(exempt)) | (set(exempt) - wanted) | (set(exempt) & there))
