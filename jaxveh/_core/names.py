"""Names: states, inputs and measurements are NamedTuples of scalars, never an index into a vector."""

from __future__ import annotations

import functools
from collections import namedtuple
from collections.abc import Iterable, Mapping
from keyword import iskeyword
from typing import Any

from jaxveh._core.errors import InputError, did_you_mean, word_for


@functools.cache
def _record_type(name: str, fields: tuple[str, ...]):
    made = namedtuple(name, fields)
    # pickle finds the class by this name (`__getattr__`), so that another process uses its own class of the same name.
    made.__qualname__ = f"{name}:{','.join(fields)}"
    return made


def __getattr__(name: str) -> Any:
    """Return the class that `record_type` makes from `Name:field,field`."""
    kind, colon, fields = name.partition(":")
    if not colon:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _record_type(kind, tuple(fields.split(",")) if fields else ())


def record_type(name: str, fields: Iterable[str]):
    """Return the NamedTuple class of this name and these fields, the same class each time, so that jit sees one structure."""
    fields = tuple(fields)
    twice = sorted({field for field in fields if fields.count(field) > 1})
    if twice:
        raise InputError(f"{name} has the field(s) {', '.join(twice)} twice: every name must be unique.")
    wrong = [field for field in fields if not (isinstance(field, str) and field.isidentifier()) or iskeyword(field)]
    if wrong:
        shown = ", ".join(map(repr, wrong))
        raise InputError(
            f"{name}: {shown}: no name of a field: it needs letters, digits and _, and may be no word of Python."
        )
    return _record_type(name, fields)


def record(name: str, values: Mapping):
    """Return a NamedTuple instance with the mapping's keys as fields, in their order."""
    return record_type(name, values.keys())(*values.values())


def as_mapping(values, what: str = "values") -> dict:
    """Return a NamedTuple, a mapping, or a data frame or a row of one, as an ordered dict of its fields."""
    if isinstance(values, Mapping) or (hasattr(values, "items") and not isinstance(values, type)):
        return dict(values.items())
    if hasattr(values, "_asdict"):
        return dict(values._asdict())
    raise InputError(f"{what} = {word_for(values)}: must be a NamedTuple or a mapping from names to values.")


def as_names(values, what: str = "names") -> Any:
    """Return names as a tuple, which a static field must be; a single string is one name, not its letters. None stays None."""
    if values is None or isinstance(values, str):
        return None if values is None else (values,)
    try:
        return tuple(values)
    except TypeError:
        raise InputError(f"{what} = {word_for(values)}: must be a name, or several.") from None


def as_groups(values) -> Any:
    """Return groups of names as a tuple of tuples; a single name is a group. None stays None."""
    return None if values is None else tuple(as_names(group, "groups") for group in as_several(values, "groups"))


def as_several(values, what: str) -> tuple:
    """Return several things as a tuple; raises `InputError` for what are none."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InputError(f"{what} = {word_for(values)}: must be several, such as a tuple.")
    return tuple(values)


def as_pairs(values, what: str) -> tuple[tuple[str, Any], ...]:
    """Return a mapping, or its pairs, as a static tuple of pairs; raises `InputError` for anything else."""
    try:
        return tuple(dict(values).items())
    except (TypeError, ValueError):
        raise InputError(f"{what} = {word_for(values)}: must be a mapping from names to values.") from None


def check_names(what: str, names: Iterable[str], allowed: Iterable[str]) -> None:
    """Raise `InputError` unless every one of `names` is among `allowed`; the message lists the allowed names."""
    allowed = tuple(allowed)
    names = () if names is None else as_names(names, what)
    # Compared one by one: an array among them would be compared with each of its elements.
    unknown = [name for name in names if not isinstance(name, str) or name not in allowed]
    if unknown:
        there = ", ".join(allowed) or "none"
        shown = ", ".join(name if isinstance(name, str) else word_for(name) for name in unknown)
        raise InputError(f"{what}: unknown name(s) {shown}; there are: {there}.{did_you_mean(unknown, allowed)}")
