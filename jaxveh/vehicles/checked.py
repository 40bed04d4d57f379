"""Check of the results of a vehicle's `evaluate`: its own mistakes are reported by name, before anything else trips over them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from jaxveh._core.errors import InputError


def with_checked_results(evaluate: Callable) -> Callable:
    """`evaluate`, whose results are checked while it is traced."""

    @functools.wraps(evaluate)
    def checked(self, *given, **options):
        results = evaluate(self, *given, **options)
        check_results(self, results)
        return results

    return checked


def check_results(vehicle: Any, results: Any) -> None:
    """Raise `InputError` unless `results` are the rates, of the vehicle's own `state_type`, and a NamedTuple of outputs."""
    who = f"{type(vehicle).__name__}.evaluate"
    if not (isinstance(results, tuple) and len(results) == 2):
        kind = f"{len(results)} results" if type(results) is tuple else type(results).__name__
        raise InputError(f"{who}: returned {kind}: must return two, (rates, outputs).")
    rates, outputs = results
    fields = vehicle.state_type._fields
    if getattr(rates, "_fields", None) != fields:
        order = " The order is (rates, outputs)." if getattr(outputs, "_fields", None) == fields else ""
        raise InputError(f"{who}: its first result is {_kind(rates)}: must be {_kind(vehicle.state_type)}.{order}")
    if not hasattr(outputs, "_fields"):
        raise InputError(f"{who}: its second result is {_kind(outputs)}: must be a NamedTuple of outputs.")


def _kind(thing: Any) -> str:
    kind = thing if isinstance(thing, type) else type(thing)
    fields = getattr(thing, "_fields", None)
    return kind.__name__ if fields is None else f"{kind.__name__}({', '.join(fields)})"
