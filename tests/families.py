"""Families of the package, by what each room lists as public: who belongs to one, and who is inside a value."""

import dataclasses
import inspect
import re

import diffrax
import equinox as eqx
import pytest

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


WRONG = {
    "none": None, "text": "eight", "an object": object(), "a list with text": [1.0, "one"], "a mapping": {"one": 1.0},
    "a class": float, "complex": 1j,
}  # fmt: skip
"""What is wrong for nearly every argument."""


def arguments_of(made):
    """The arguments of a function or class, but for those that it takes by any name."""
    return [one for one in inspect.signature(made).parameters.values() if one.kind is not one.VAR_KEYWORD]


def may_be(argument, wrong):
    """Whether a wrong thing is right for an argument: an option that is off; of a flag Python takes anything."""
    return isinstance(argument.default, bool) or (
        wrong is None and "None" in str(argument.annotation) + str(argument.default)
    )


def refuses(made, given, argument, said="", taken=()):
    """Assert that an argument is refused by name, whatever wrong thing it is; `said`: other names of it in messages."""
    for kind, wrong in WRONG.items():
        if may_be(argument, wrong) or kind in taken:
            continue
        with pytest.raises(jaxveh.InputError) as told:
            pytest.fail(f"{made.__name__}({argument.name}={wrong!r}) is {made(**given | {argument.name: wrong})}")
        assert re.search(f"{argument.name}|{said or argument.name}", str(told.value)), (argument, kind)


def modules_in(value, seen=None):
    """The modules that a value is or has inside, one of each class."""
    seen = set() if seen is None else seen
    if isinstance(value, eqx.Module) and type(value) not in seen:
        seen.add(type(value))
        yield value
        for entry in dataclasses.fields(value):
            yield from modules_in(getattr(value, entry.name, None), seen)


def refuses_everywhere(value, seen, taken=()):
    """Assert `refuses` of each argument of each class in a value that is not yet in `seen`; `taken`: names of arguments that
    are looked at elsewhere."""
    for one in modules_in(value, seen):
        made = type(one)
        asked = [argument for argument in arguments_of(made) if hasattr(one, argument.name)]
        given = {argument.name: getattr(one, argument.name) for argument in asked}
        made(**given)
        for argument in asked:
            if argument.name not in taken:
                refuses(made, given, argument, said="inside" if argument.name == "inner" else "")
