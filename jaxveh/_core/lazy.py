"""Modules of a package, and names inside them, that are imported when they are first asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any


def submodules(package: str, names: Iterable[str], inside: Mapping[str, str] | None = None) -> Callable[[str], Any]:
    """The `__getattr__` of a `package` whose modules `names`, and names `inside` its modules (name to module), are imported when
    they are first asked for."""
    known, inside = frozenset(names), dict(inside or {})

    def find(name: str) -> Any:
        if name in known:
            return importlib.import_module(f"{package}.{name}")
        if name in inside:
            return getattr(importlib.import_module(f"{package}.{inside[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return find
