"""Families of the package, by what each room lists as public: who belongs to one, and who is inside a value."""

import dataclasses
import inspect
import re

import diffrax
import equinox as eqx
import jax
import numpy as np
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


def listed_modules(module=jaxveh, seen=None):
    """The modules that a user reaches from the package by what each lists (`__all__`), by name without `jaxveh.`."""
    seen = {} if seen is None else seen
    for name in getattr(module, "__all__", ()):
        one = getattr(module, name)
        short = one.__name__.removeprefix("jaxveh.") if inspect.ismodule(one) else ""
        if short and short != one.__name__ and short not in seen:
            seen[short] = one
            listed_modules(one, seen)
    return seen


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
    that are none, or are there all the same; each with what to do."""
    there = set().union(*(kinds_in(value, base) for value in values))
    return wanting(members(room, base), {name for name in there if name in members(room, base)}, exempt)


def wanting(wanted, there, exempt, where="here"):
    """The names of a family that a table lacks, has too much, or exempts in vain, each with what to do. `where`: the table, if it
    is in another file than the reasons."""
    return [
        *(f"{name}: has no line {where}: add one, or a reason why not (CONTRIBUTING, Five recipes)"
          for name in sorted(wanted - there - set(exempt))),
        *(f"{name}: has a line {where}, but is not listed: remove the line, or list it" for name in sorted(there - wanted)),
        *(f"{name}: has a reason why not, but is not listed: remove the reason" for name in sorted(set(exempt) - wanted)),
        *(f"{name}: has a line and a reason why not: remove one" for name in sorted(set(exempt) & there)),
    ]  # fmt: skip


WRONG = {
    "none": None, "text": "eight", "an object": object(), "a list with text": [1.0, "one"], "a mapping": {"one": 1.0},
    "a class": float, "complex": 1j,
}  # fmt: skip
"""What is wrong for nearly every argument."""


def arguments_of(made):
    """The arguments of a function or class, but for those that it takes by any name."""
    return [one for one in inspect.signature(made).parameters.values() if one.kind is not one.VAR_KEYWORD]


def may_be(argument, wrong):
    """Whether a wrong thing is right for an argument: an option that is off."""
    return wrong is None and "None" in str(argument.annotation) + str(argument.default)


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


def arrays_among(made, given):
    """The arguments of a function or class that are arrays or numbers of floating point, by name."""
    asked = {one.name: given.get(one.name, one.default) for one in arguments_of(made)}
    numbers = {name: value for name, value in asked.items() if isinstance(value, float) or eqx.is_inexact_array(value)}
    return {name: np.asarray(value, float) for name, value in numbers.items()}


def or_refused(make, name):
    """What `make()` makes, or None if it refuses an argument by its name."""
    try:
        return make()
    except jaxveh.InputError as refusal:
        said = str(refusal)
    assert name in said
    return None


def is_made_inside_jit(made, given):
    """Assert that a function or class takes its arguments inside jit, each as a tracer among known ones, or refuses it by
    name."""
    jax.eval_shape(lambda x: (made(**given), x)[1], 1.0)
    for name, value in arrays_among(made, given).items():
        make = lambda traced, name=name: or_refused(lambda: made(**given | {name: traced}), name)
        jax.eval_shape(lambda traced, make=make: (make(traced), traced)[1], value)


def keeps_copies(made, given):
    """Assert that a module made of arrays stays as it is when the caller writes into them."""
    for name, value in arrays_among(made, given).items():
        # Of an array at a multiple of 64 bytes jax shares the memory.
        room = np.zeros(value.nbytes + 64, np.uint8)
        start = -room.ctypes.data % 64
        mine = room[start : start + value.nbytes].view(float).reshape(value.shape)
        mine[...] = value
        one = or_refused(lambda name=name, mine=mine: made(**given | {name: mine}), name)
        leaves = [leaf for leaf in jax.tree.leaves(one) if isinstance(one, eqx.Module) and eqx.is_array(leaf)]
        before = [np.array(leaf) for leaf in leaves]
        mine[...] = 7.0
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, leaves, strict=True)), name


def refuses_arrays_as_settings(made, given):
    """Assert that the numbers that are static, parts of the program, are no arrays: jax compares them to find a compiled program,
    which of an array fails at some later call, also of another module."""
    static = {field.name for field in dataclasses.fields(made) if field.metadata.get("static")}
    for name in static & set(given):
        value = given[name]
        if not isinstance(value, int | float) or isinstance(value, bool):
            continue
        made(**given | {name: np.asarray(value)[()]})
        for wrong in (np.asarray(value), jax.numpy.asarray(value)):
            with pytest.raises(jaxveh.InputError, match=name):
                made(**given | {name: wrong})
        with pytest.raises(jaxveh.InputError, match=name):
            jax.eval_shape(lambda traced, name=name: (made(**given | {name: traced}), traced)[1], value)


def made_again(value, seen):
    """Each class in a value, that is not yet in `seen`, with what it is called with to make the same once more."""
    for one in modules_in(value, seen):
        asked = [argument.name for argument in arguments_of(type(one))]
        yield type(one), {name: getattr(one, name) for name in asked if hasattr(one, name)}
