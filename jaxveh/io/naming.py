"""Messages about unknown names, with the nearest known names first."""

from __future__ import annotations

from collections.abc import Iterable

from jaxveh._core.errors import InputError, near

_SHOWN = 30


def listing(name: str, names: Iterable[str]) -> str:
    """List all names in words, those similar to `name` first; a long list is cut, with a count of the rest."""
    names = list(names)
    close = near(name, names)
    ordered = close + [candidate for candidate in names if candidate not in close]
    if not ordered:
        return "there are none"
    more = f", and {len(ordered) - _SHOWN} more" if len(ordered) > _SHOWN else ""
    return f"there are: {', '.join(ordered[:_SHOWN])}{more}"


def check_known(what: str, kind: str, name: str, names: Iterable[str], advice: str = "") -> None:
    """Raise `InputError` unless `name` is among `names`: "`what`: no `kind` `name`; there are: ..."."""
    names = list(names)
    if name in names:
        return
    close = near(name, names)
    guess = f" (did you mean {close[0]!r}?)" if close else ""
    raise InputError(f"{what}: no {kind} {name!r}{guess}; {listing(name, names)}.{f' {advice}' if advice else ''}")
