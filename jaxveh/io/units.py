"""Units: their names in files, and conversion to SI through pint."""

from __future__ import annotations

import functools
from typing import TypeGuard

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.optional import require

_NOT_GIVEN = frozenset({"", "-", "--", "none", "n/a", "na", "nan", "unknown", "?"})

# Units that pint does not know or takes for something else (`Nm` as number times metre, `g` as gram).
_ALIASES = {"m/s2": "m/s^2", "m/s/s": "m/s^2", "mps": "m/s", "mps2": "m/s^2", "kmh": "km/h", "Nm": "N*m", "N m": "N*m"}
_ALIASES |= {"kNm": "kN*m", "U/min": "rpm", "1": "dimensionless"}
_ALIASES_FOR = {
    "m/s^2": {"g": "standard_gravity", "G": "standard_gravity", "m/s**2": "m/s^2"},
    # An angle has no dimension, so that 1/s is a valid name for rad/s; hertz and per cent are not.
    "rad/s": {"1/s": "rad/s", "s^-1": "rad/s", "1/min": "rpm"},
    "rad": {"1": "rad"},
}


def is_unit(unit: str | None) -> TypeGuard[str]:
    """Whether a unit is given: not empty, `-`, `n/a` and the like."""
    return unit is not None and unit.strip().casefold() not in _NOT_GIVEN


def same_unit(unit: str, other: str) -> bool:
    """Whether two units are the same, though written differently, such as `N m` and `N*m`."""
    plain = lambda one: _ALIASES.get(one.strip(), one.strip())
    return plain(unit) == plain(other)


def convert(values, unit: str, target: str, what: str) -> np.ndarray:
    """Convert values (any shape) from `unit` to `target`; if the units are equal, the values are unchanged.

    Angles count as a dimension of their own: `rad/s` takes `deg/s` and `rpm`, not `Hz` (which would miss 2 pi) or `%`.
    For an acceleration `g` is the standard gravity. `what` is the beginning of the message.

    **Raises** `InputError` for an unknown unit, or a unit of another quantity.
    """
    unit = unit.strip()
    if unit == target:
        return np.asarray(values)
    unit = _ALIASES_FOR.get(target, {}).get(unit, _ALIASES.get(unit, unit))
    if unit == target:
        return np.asarray(values)
    registry = _registry()
    try:
        source, wanted = _parse(unit), _parse(_ALIASES.get(target, target))
    except Exception as error:  # pint raises its own, AttributeError, ValueError and tokenizer errors alike
        raise InputError(
            f"{what}: unit {unit!r} is not known. Write it as in `m/s`, `deg/s`, `m/s^2`, `km/h`, `N*m`, `g`."
        ) from error
    if registry.get_root_units(source)[1] != registry.get_root_units(wanted)[1]:
        raise InputError(
            f"{what}: unit {unit!r} is of another quantity; it must be convertible to {target!r}. "
            "Correct the unit in the channel map, or map another column."
        )
    return np.asarray(registry.Quantity(np.asarray(values, dtype=np.float64), source).to(wanted).magnitude)


@functools.cache
def _registry():
    return require("pint", "converting units").UnitRegistry()


@functools.cache
def _parse(unit: str):
    return _registry().parse_units(unit)
