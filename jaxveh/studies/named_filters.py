"""Filters by name, with their options as plain values, as a study's file gives them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from typing import Any

from jaxveh import filters
from jaxveh._core.errors import InputError
from jaxveh.io import kit
from jaxveh.statespace import AbstractFilter


def kebab(name: str) -> str:
    """`AuxiliaryParticleFilter` as `auxiliary-particle-filter`."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", name).lower()


def _every_filter() -> dict[str, type[AbstractFilter]]:
    members = ((name, getattr(filters, name)) for name in filters.__all__)
    is_filter = lambda kind: inspect.isclass(kind) and issubclass(kind, AbstractFilter) and not inspect.isabstract(kind)
    return {kebab(name): kind for name, kind in members if is_filter(kind)}


FILTERS = _every_filter()
"""Every filter and wrapper of `jaxveh.filters`, by name."""

FORMS = {kebab(kind.__name__): kind for kind in (filters.Covariance, filters.SquareRoot, filters.SingularValues)}
"""The forms of a Gaussian filter's covariance, by name."""


def filter_options(name: str) -> list[str]:
    """The options of a filter by its name in `FILTERS`."""
    return list(inspect.signature(FILTERS[name]).parameters)


def filter_of(told: str | Mapping[str, Any], where: str = "filter") -> AbstractFilter:
    """The filter of a name, or of a table with `name` and its options: plain values, `form` by name, `inner` as a filter
    again.

        filter_of({"name": "gated", "limit": 3.0, "inner": "extended"})

    **Raises** `InputError` for an unknown name or option, and as the filter's class does.
    """
    table = {"name": told} if isinstance(told, str) else dict(told)
    name = table.pop("name", None)
    if not isinstance(name, str):
        raise InputError(f"{where}: name is missing; it must be one of {', '.join(FILTERS)}.")
    kit.check_known(where, "filter", name, FILTERS)
    kind = FILTERS[name]
    known = inspect.signature(kind).parameters
    for option in table:
        kit.check_known(f"{where} {name}", "option", option, known)
    missing = [one.name for one in known.values() if one.default is one.empty and one.name not in table]
    if missing:
        raise InputError(f"{where} {name}: needs {', '.join(missing)}; give it as a key beside the name.")
    options = {option: _option(f"{where} {name}", option, value) for option, value in table.items()}
    try:
        return kind(**options)
    except TypeError as error:
        raise InputError(f"{where} {name}: {error}.") from None


def _option(where: str, option: str, value: Any) -> Any:
    if option == "inner":
        return filter_of(value, f"{where}, inner")
    if option == "form":
        kit.check_known(where, "form", str(value), FORMS)
        return FORMS[value]()
    return _plain(value)


def _plain(value: Any) -> Any:
    """Lists as tuples, at any depth."""
    return tuple(_plain(one) for one in value) if isinstance(value, list) else value
