"""Names of columns: with their units, and in messages about unknown ones, with the nearest first."""

from __future__ import annotations

import re
from collections.abc import Iterable

from jaxveh._core.errors import InputError, near
from jaxveh.io.units import is_unit_name

MOST_NAMED = 30
"""The number of names that a message lists."""

# `wheel[3]` is a name, `speed [km/h]` is a name and a unit; `speed (km/h)` too, but not `speed (GPS)`.
_UNIT_IN_NAME = re.compile(r"^(?P<name>.*\S)\s*\[(?!\d+\])(?P<unit>[^\[\]]*)\]$")
_UNIT_IN_ROUND = re.compile(r"^(?P<name>.*\S)\s*\((?!\d+\))(?P<unit>[^()]+)\)$")


def listing(name: str, names: Iterable[str]) -> str:
    """List all names in words, those similar to `name` first; a long list is cut, with a count of the rest."""
    names = list(names)
    close = near(name, names)
    ordered = close + [candidate for candidate in names if candidate not in close]
    if not ordered:
        return "there are none"
    more = f", and {len(ordered) - MOST_NAMED} more" if len(ordered) > MOST_NAMED else ""
    return f"there are: {', '.join(ordered[:MOST_NAMED])}{more}"


def check_known(what: str, kind: str, name: str, names: Iterable[str], advice: str = "") -> None:
    """Raise `InputError` unless `name` is among `names`: "`what`: no `kind` `name`; there are: ..."."""
    names = list(names)
    if name in names:
        return
    close = near(name, names)
    guess = f" (did you mean {close[0]!r}?)" if close else ""
    raise InputError(f"{what}: no {kind} {name!r}{guess}; {listing(name, names)}.{f' {advice}' if advice else ''}")


def split_unit(heading: str) -> tuple[str, str]:
    """`yaw_rate [deg/s]` or `yaw_rate (deg/s)` as `("yaw_rate", "deg/s")`; a heading without a unit has the unit ""."""
    match = _UNIT_IN_NAME.match(heading)
    if match is None and (found := _UNIT_IN_ROUND.match(heading)) is not None and is_unit_name(found["unit"].strip()):
        match = found
    return (match["name"], match["unit"].strip()) if match else (heading.strip(), "")
