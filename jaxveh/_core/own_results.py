"""Checks of what the methods of a class of a user's own return (`contracts.Checked`)."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jaxveh._core.contracts import Check
from jaxveh._core.errors import NOT_REAL, InputError, word_for, word_for_kind


def numbers_as_given(who: str, given: Any, result: Any) -> None:
    """Raise `InputError` for a number, or a field of a NamedTuple, that is no real number or has an axis that nothing given
    has."""
    shapes = {np.shape(leaf) for leaf in jax.tree.leaves(given) if hasattr(leaf, "shape")}
    try:
        whole = np.broadcast_shapes(*shapes)
    except ValueError:  # A table among the parameters.
        whole = None
    fields = result._asdict() if hasattr(result, "_fields") else {"its result": result}
    for name, value in fields.items():
        if not isinstance(value, int | float) and getattr(getattr(value, "dtype", None), "kind", "O") in NOT_REAL:
            raise InputError(f"{who}: {name} is {word_for(value)}: must be a real number, or an array of real numbers.")
        if whole is not None and not _fits(np.shape(value), whole):
            raise InputError(
                f"{who}: {name} has shape {np.shape(value)}: must be elementwise, of the shape of what it is given, {whole}."
            )


def _fits(shape: tuple[int, ...], whole: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, whole) == whole
    except ValueError:
        return False


def of_kind(kind: Any, *, numbers: bool = True) -> Check:
    """The check that a result is a NamedTuple with the fields of `kind`, by default of `numbers` as `numbers_as_given`."""

    def check(who: str, owner: Any, given: tuple, result: Any) -> None:
        if getattr(result, "_fields", None) != kind._fields:
            raise InputError(f"{who}: returned {word_for(result)}: must return {word_for_kind(kind)}.")
        if numbers:
            numbers_as_given(who, (owner, given), result)

    return check


def number(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a result is a number or an array of numbers, as `numbers_as_given`."""
    numbers_as_given(who, (owner, given), result)


def named_numbers(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a result is a NamedTuple of numbers, as `numbers_as_given`."""
    named_record(who, owner, given, result)
    numbers_as_given(who, (owner, given), result)


def named_record(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a result is a NamedTuple; its fields may be of any kind."""
    del owner, given
    if not hasattr(result, "_fields"):
        raise InputError(f"{who}: returned {word_for(result)}: must return a NamedTuple.")


def states(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a result is a tuple with a value for each of the `state_names`."""
    del given
    if not isinstance(result, tuple) or len(result) != len(owner.state_names):
        shown = f"{len(result)} values" if type(result) is tuple else word_for(result)
        raise InputError(f"{who}: returned {shown}: must return a NamedTuple of ({', '.join(owner.state_names)}).")


def not_none(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a method returned something."""
    del owner, given
    if result is None:
        raise InputError(f"{who}: returned None: must return its result.")


def several(*kinds: Any, order: str) -> Check:
    """The check that there is a result of each of these kinds, in this `order`, in words."""

    def check(who: str, owner: Any, given: tuple, result: Any) -> None:
        del owner, given
        if type(result) is not tuple or len(result) != len(kinds):
            shown = f"{len(result)} results" if type(result) is tuple else word_for(result)
            raise InputError(f"{who}: returned {shown}: must return {order}.")
        for value, kind in zip(result, kinds, strict=True):
            if not isinstance(value, kind):
                raise InputError(f"{who}: returned ({', '.join(map(word_for, result))}): must return {order}.")

    return check


def belief_and_info(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a filter returned two, and that the second, the info, is a NamedTuple."""
    several(object, object, order="two, (belief, info)")(who, owner, given, result)
    if not hasattr(result[1], "_fields"):
        raise InputError(f"{who}: returned ({', '.join(map(word_for, result))}): must return two, (belief, info).")


def instance_of(kind: Any, such_as: str) -> Check:
    """The check that a result is an instance of a class."""

    def check(who: str, owner: Any, given: tuple, result: Any) -> None:
        del owner, given
        if not isinstance(result, kind):
            shown = word_for(result) + ", not called" * isinstance(result, type)
            raise InputError(f"{who}: returned {shown}: must return {such_as}.")

    return check


def names(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Check that a property is a tuple of names: a single string in parentheses would be taken for its letters."""
    del owner, given
    if isinstance(result, str):
        raise InputError(f"{who} = {result!r}: must be a tuple of names; one name has a comma: ({result!r},).")
    if not isinstance(result, tuple | list) or not all(isinstance(name, str) for name in result):
        raise InputError(f"{who} = {result!r}: must be a tuple of names.")
