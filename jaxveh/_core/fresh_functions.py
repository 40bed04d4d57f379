"""Functions that are written inside a loop: a new one at each turn, and with each a program that is compiled anew."""

from __future__ import annotations

import types
import warnings
import weakref
from typing import Any

from jaxveh._core.errors import JaxvehWarning

TURNS = 5
"""So many functions of one place in the source are a loop."""

_counts: dict[types.CodeType, int] = {}
_seen: weakref.WeakSet = weakref.WeakSet()


def note_function(who: str, function: Any) -> None:
    """Warn (`JaxvehWarning`), once a place, where `who` was given function after function from the same line of the source."""
    if not isinstance(function, types.FunctionType) or function in _seen:
        return
    _seen.add(function)
    code = function.__code__
    _counts[code] = _counts.get(code, 0) + 1
    if _counts[code] == TURNS:
        warnings.warn(
            f"{who}: {function.__name__} of {code.co_filename}, line {code.co_firstlineno}, is a new function at each call, "
            f"{TURNS} so far, and each compiles a program anew. Write it once, outside of the loop, and give it what varies as "
            "an array.",
            JaxvehWarning,
            stacklevel=3,
        )
