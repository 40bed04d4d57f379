"""Modules of a package, and names inside them, that are imported when they are first used."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any


def submodules(package: str, names: Iterable[str], inside: Mapping[str, str] | None = None) -> Callable[[str], Any]:
    """Return the `__getattr__` of a `package` that imports its modules and their names when they are first used.

    `names`: the modules; `inside`: names inside the modules, name to module.
    """
    known, inside = frozenset(names), dict(inside or {})

    def find(name: str) -> Any:
        if name in known:
            return importlib.import_module(f"{package}.{name}")
        if name in inside:
            return getattr(importlib.import_module(f"{package}.{inside[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return find
