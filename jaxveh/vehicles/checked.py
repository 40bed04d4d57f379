"""Checks of what a vehicle's own methods return: its mistakes are reported by name, before anything else trips over them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jaxveh._core.errors import InputError, word_for, word_for_kind
from jaxveh._core.own_results import numbers_as_given


def rates_and_outputs(who: str, vehicle: Any, given: tuple, results: Any) -> None:
    """Raise `InputError` unless `results` are the rates, of the vehicle's own `state_type`, and a NamedTuple of outputs, all real
    numbers of the shape of what is given."""
    if not (isinstance(results, tuple) and len(results) == 2):
        kind = f"{len(results)} results" if type(results) is tuple else word_for(results)
        raise InputError(f"{who}: returned {kind}: must return two, (rates, outputs).")
    rates, outputs = results
    fields = vehicle.state_type._fields
    if getattr(rates, "_fields", None) != fields:
        order = " The order is (rates, outputs)." if getattr(outputs, "_fields", None) == fields else ""
        raise InputError(
            f"{who}: its first result is {word_for(rates)}: must be {word_for_kind(vehicle.state_type)}.{order}"
        )
    if not hasattr(outputs, "_fields"):
        raise InputError(f"{who}: its second result is {word_for(outputs)}: must be a NamedTuple of outputs.")
    numbers_as_given(f"{who}: rates", (vehicle, given), rates)
    numbers_as_given(f"{who}: outputs", (vehicle, given), outputs)


def state(who: str, vehicle: Any, given: tuple, result: Any) -> None:
    """Raise `InputError` unless a result is the vehicle's state, or a tuple of as many numbers."""
    del given
    fields = vehicle.state_type._fields
    unnamed = type(result) is tuple and len(result) == len(fields)
    if not unnamed and getattr(result, "_fields", None) != fields:
        raise InputError(f"{who}: returned {word_for(result)}: must return {word_for_kind(vehicle.state_type)}.")


def state_type(who: str, vehicle: Any, given: tuple, result: Any) -> None:
    """Raise `InputError` unless a vehicle's `state_type` is the class of a NamedTuple."""
    del vehicle, given
    if not isinstance(result, type) or not hasattr(result, "_fields"):
        raise InputError(f"{who} = {result!r}: must be a class of NamedTuple, not called.")


def units(who: str, owner: Any, given: tuple, result: Any) -> None:
    """Raise `InputError` unless units are a mapping."""
    del owner, given
    if not isinstance(result, Mapping):
        raise InputError(f'{who} = {result!r}: must be a mapping from names to units, such as {{"yaw_rate": "rad/s"}}.')
