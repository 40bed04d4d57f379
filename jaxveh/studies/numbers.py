"""Numbers of an object replaced by name: a car's mass, a device's noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from jaxveh._core.bijectors import Positive
from jaxveh._core.errors import InputError, check_finite, check_positive
from jaxveh._core.parameter import every_parameter, pick, put
from jaxveh.io import kit


def with_numbers(what: str, thing: Any, numbers: Mapping[str, Any]) -> Any:
    """`thing` with these numbers replaced, by name (`mass`, `front.B`).

    **Raises** `InputError` for an unknown name, with similar names, and for a value out of its range (tracers pass).
    """
    if not numbers:
        return thing
    known = every_parameter(thing)
    for name, value in numbers.items():
        kit.check_known(what, f"number of {type(thing).__name__}", name, known)
        check = check_positive if isinstance(known[name].domain, Positive) else check_finite
        check(f"{what}.{name}", value, known[name].unit)
    chosen = tuple(known[name] for name in numbers)
    values = []
    for (name, value), old in zip(numbers.items(), pick(thing, chosen), strict=True):
        shape = jnp.shape(old)
        if jnp.shape(value) not in ((), shape):
            allowed = f"one number, or numbers of shape {shape}" if shape else "one number"
            raise InputError(f"{what}.{name} = {kit.shorten(value)}: must be {allowed}.")
        values.append(jnp.broadcast_to(jnp.asarray(value, jnp.asarray(old).dtype), shape))
    return put(thing, chosen, values)


def unit_of(thing: Any, name: str) -> str:
    """The unit of a number by its name; `-` if it has none, or if there is no such number."""
    known = every_parameter(thing)
    return known[name].unit if name in known else "-"


def flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """A nested table as one with dotted names."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        found |= flat(value, f"{before}{name}.") if isinstance(value, Mapping) else {f"{before}{name}": value}
    return found
