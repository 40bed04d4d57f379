"""Units: their names in files, and conversion to SI through pint."""

from __future__ import annotations

import functools
import re
from typing import TypeGuard

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.optional import require

_NOT_GIVEN = frozenset({"", "-", "--", "none", "n/a", "na", "nan", "unknown", "?"})

# Units that pint does not know or takes for something else (`Nm` as number times metre, `g` as gram, `kmph` as 1000 mph).
_ALIASES = {"m/s2": "m/s^2", "m/s/s": "m/s^2", "mps": "m/s", "mps2": "m/s^2", "kmh": "km/h", "Nm": "N*m", "N m": "N*m"}
_ALIASES |= {"kNm": "kN*m", "N-m": "N*m", "U/min": "rpm", "1": "dimensionless", "N/m2": "N/m^2"}
_ALIASES_FOR = {
    "m/s^2": {"g": "standard_gravity", "G": "standard_gravity", "mg": "millistandard_gravity", "m/s**2": "m/s^2"},
    # An angle has no dimension, so that 1/s is a valid name for rad/s; hertz and per cent are not.
    "rad/s": {"1/s": "rad/s", "s^-1": "rad/s", "1/min": "rpm", "min^-1": "rpm", "rev/min": "rpm"},
    "rad": {"1": "rad"},
    "s": {"unix time": "s", "Unix time": "s", "epoch": "s"},
}
_IN_ANY_CASE = {
    "km/h": ("km/h", "kmh", "kph", "kmph", "km/hr"), "mph": ("mph",), "deg": ("deg", "degree", "degrees"),
    "deg/s": ("deg/s", "dps", "degps", "deg/sec", "degree/s", "degrees/s"), "rad": ("rad",), "rad/s": ("rad/s",),
    "rpm": ("rpm",), "bar": ("bar",), "psi": ("psi",), "kPa": ("kpa",), "percent": ("percent", "pct"), "s": ("sec",),
}  # fmt: skip
"""Spellings that mean the same in capitals and in small letters, by the unit."""
_SPELLINGS = {spelling: unit for unit, spellings in _IN_ANY_CASE.items() for spelling in spellings}

_PREFIXED = {
    "meter": ("kilo", "deci", "centi", "milli", "micro"), "second": ("milli", "micro", "nano"), "gram": ("kilo", "milli"),
    "newton": ("kilo", "mega", "deca"), "pascal": ("hecto", "kilo", "mega"), "bar": ("milli",), "joule": ("kilo",),
    "radian": ("milli", "micro"), "degree": ("milli",), "standard_gravity": ("milli",), "hertz": ("kilo", "mega"),
}  # fmt: skip
"""The prefixes with which a unit is in use. pint puts any prefix in front of any unit: Grad would be a gigaradian."""

_QUANTITIES = ("m/s", "rad", "rad/s", "m/s^2", "m", "N", "N*m", "Pa", "1")
_LETTERS = ("s", "m", "g", "G", "N", "°", "%")
"""Single letters that are units in a name. Others tell one channel from another, such as `c` (for pint, the speed of light)."""
_TIMES = ("s", "sec", "ms", "us", "µs", "ns")

_GRAD = re.compile(r"grad\b", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[(<]([^][()<>]*)[])>]")
_POWER = re.compile(r"(?<=[A-Za-z])-(?=\d)|(?<=[A-Za-z])(?=[23]\b)")
_TIMES_SIGN = re.compile(r"(?<=\w) ?[.·⋅×] ?(?=[A-Za-z°])")


def is_unit(unit: str | None) -> TypeGuard[str]:
    """Whether a unit is given: not empty, `-`, `n/a` and the like."""
    return unit is not None and without_brackets(unit).casefold() not in _NOT_GIVEN


def without_brackets(unit: str) -> str:
    """The unit of a text such as `[km/h]`, as many loggers write units on a line of their own."""
    said = unit.strip()
    inside = _BRACKETS.fullmatch(said)
    return said if inside is None else inside[1].strip()


def same_unit(unit: str, other: str) -> bool:
    """Whether two units are the same, though written differently, such as `N m` and `N*m`."""
    plain = lambda one: _ALIASES.get(without_brackets(one), without_brackets(one))
    return plain(unit) == plain(other)


def convert(values, unit: str, target: str, what: str) -> np.ndarray:
    """Convert values (any shape) from `unit` to `target`; if the units are equal, the values are unchanged.

    Angles count as a dimension of their own: `rad/s` takes `deg/s` and `rpm`, not `Hz` (which would miss 2 pi) or `%`.
    For an acceleration `g` is the standard gravity. `what` is the beginning of the message.

    **Raises** `InputError` for an unknown unit, or a unit of another quantity.
    """
    said = without_brackets(unit)
    if said == target:
        return np.asarray(values)
    unit = _spelled(said, target)
    if unit == target:
        return np.asarray(values)
    if _GRAD.match(unit):
        raise InputError(f"{what}: unit {said!r} may be degrees or gradians. Write `deg` (in a channel map), or `gon`.")
    _check_no_rotation(said, target, what)
    registry = _registry()
    try:
        source, wanted = _parse(unit), _parse(_ALIASES.get(target, target))
    except Exception as error:  # pint raises its own, AttributeError, ValueError and tokenizer errors alike
        raise InputError(
            f"{what}: unit {said!r} is not known. Write it as in `m/s`, `deg/s`, `m/s^2`, `km/h`, `N*m`, `g`."
        ) from error
    if registry.get_root_units(source)[1] != registry.get_root_units(wanted)[1]:
        raise InputError(
            f"{what}: unit {unit!r} is of another quantity; it must be convertible to {target!r}. "
            "Correct the unit in the channel map, or map another column."
        )
    return np.asarray(registry.Quantity(np.asarray(values, dtype=np.float64), source).to(wanted).magnitude)


def _check_no_rotation(said: str, target: str, what: str) -> None:
    """Raise `InputError` for a wheel's rotation in place of its speed, with the scale that makes it one."""
    if target != "m/s":
        return
    registry = _registry()
    try:
        turning = _parse(_spelled(said, "rad/s"))
        root = registry.get_root_units(turning)[1]
    except Exception:  # as in `convert`, which says so
        return
    if root == registry.get_root_units(_parse("rad/s"))[1]:
        factor = registry.Quantity(1.0, turning).to("rad/s").magnitude
        raise InputError(
            f"{what}: unit {said!r} is of another quantity; it must be convertible to {target!r}. A wheel's rotation times its "
            f'rolling radius is its speed: in the channel map, scale = {factor:.9g} times the radius (m), and unit = "m/s"; '
            "or name the channel omega_fl, omega_fr, omega_rl, omega_rr."
        )


@functools.cache
def is_unit_name(text: str) -> bool:
    """Whether a text in the place of a unit is one of a channel's, such as `km/h`; not GPS, max or l for left."""
    if len(text) == 1 and text not in _LETTERS:
        return False
    if text in _TIMES or _GRAD.match(text):
        return True
    for quantity in _QUANTITIES:
        try:
            convert(1.0, text, quantity, "unit")
        except InputError:
            continue
        return True
    return False


@functools.cache
def _registry():
    return require("pint", "converting units").UnitRegistry()


@functools.cache
def _parse(unit: str):
    """Return the unit of pint; raise `ValueError` for a unit with a prefix that is not in use."""
    registry = _registry()
    parsed = registry.parse_units(unit)
    for name in dict(registry.Quantity(1.0, parsed).unit_items()):
        prefix, plain, _ = registry.parse_unit_name(name)[0]
        if prefix and prefix not in _PREFIXED.get(plain, ()):
            raise ValueError(f"{prefix} in front of {plain}")
    # Raises an error of its own for a power whose factor no number holds.
    registry.get_root_units(parsed)
    return parsed


def _spelled(unit: str, target: str) -> str:
    """Return a unit in the spelling of pint, or unchanged."""
    unit = " ".join(unit.replace("º", "°").split())
    if unit not in _ALIASES:
        unit = _TIMES_SIGN.sub("*", unit)  # pint reads dots up to its version 0.25
        unit = _POWER.sub(lambda found: "^" + found[0], unit)
    unit = _SPELLINGS.get(unit.casefold(), unit)
    return _ALIASES_FOR.get(target, {}).get(unit, _ALIASES.get(unit, unit))
