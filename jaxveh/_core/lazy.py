"""Modules of a package that are imported when they are first asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from typing import Any


def submodules(package: str, names: Iterable[str]) -> Callable[[str], Any]:
    """The `__getattr__` of a `package` whose modules `names` are imported when they are first asked for."""
    known = frozenset(names)

    def find(name: str) -> Any:
        if name in known:
            return importlib.import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return find
