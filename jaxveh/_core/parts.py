"""What a module is made of: a field that is annotated as a module or a NamedTuple holds one of that kind, and one that is static
holds no array."""

from __future__ import annotations

import dataclasses
import functools
import typing
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxveh._core.errors import InputError, check_flags, word_for

FEW = 6
"""The largest number of members of a family that a message lists."""


def check_parts(module: eqx.Module) -> None:
    """Raise `InputError` unless every field that is annotated as a module or a NamedTuple holds one of that kind."""
    for name, kinds in _kinds_of_parts(type(module)).items():
        value = getattr(module, name)
        if not isinstance(value, kinds):
            wanted = " or ".join(_in_words(kind) for kind in kinds if kind is not type(None))
            raise InputError(f"{type(module).__name__}.{name} = {word_for(value)}: must be {wanted}.")


def check_static(module: eqx.Module) -> None:
    """Raise `InputError` if a static field holds an array, traced or not, or one that is a flag neither True nor False.

    It is a part of the program: jax finds a compiled program by comparing it, which of an array fails at some later call, also
    at one of another module that holds a number.
    """
    for name in _static_fields(type(module)):
        value = getattr(module, name)
        if any(isinstance(leaf, jax.Array | np.ndarray) for leaf in jax.tree.leaves(value)):
            raise InputError(
                f"{type(module).__name__}.{name} = {value!r}: must be of plain numbers, such as float(value), known outside of "
                "jit, vmap and grad: it is a part of the compiled program."
            )
    check_flags(**{f"{type(module).__name__}.{name}": getattr(module, name) for name in _flags(type(module))})


@functools.cache
def _static_fields(kind: type) -> tuple[str, ...]:
    """The names of the static fields."""
    return tuple(field.name for field in dataclasses.fields(kind) if field.metadata.get("static"))


@functools.cache
def _flags(kind: type) -> tuple[str, ...]:
    """The names of the static fields that are True or False."""
    return tuple(f.name for f in dataclasses.fields(kind) if f.metadata.get("static") and f.type in (bool, "bool"))


def _in_words(kind: type) -> str:
    """A kind as a message names it, with its members if they are few: a steering of jaxveh.vehicles: FrontSteering, ..."""
    room = ".".join(kind.__module__.split(".")[:2])
    if not kind.__name__.startswith("Abstract"):
        return f"a {kind.__name__} of {room}"
    made = [one.__name__ for one in kind.__subclasses__() if one.__module__.startswith(room)]
    members = [name for name in made if not name.startswith(("Abstract", "_"))]
    listed = f": {', '.join(members)}" if 0 < len(members) <= FEW else ""
    return f"a {kind.__name__.removeprefix('Abstract').lower()} of {room}{listed}"


@functools.cache
def _kinds_of_parts(kind: type) -> dict[str, tuple[type, ...]]:
    """The kinds that the annotation of a field names, by the field's name; fields of anything else are left out."""
    try:
        hints = typing.get_type_hints(kind)
    except (NameError, TypeError):
        # A class made within a function, or one that another library checks.
        return {}
    named: dict[str, tuple[Any, ...]] = {
        f.name: typing.get_args(hints.get(f.name)) or (hints.get(f.name),) for f in dataclasses.fields(kind)
    }
    return {name: kinds for name, kinds in named.items() if all(map(_is_part, kinds)) and kinds != (type(None),)}


def _is_part(kind: Any) -> bool:
    is_tuple = isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")
    return kind is type(None) or is_tuple or (isinstance(kind, type) and issubclass(kind, eqx.Module))
