"""Functions that are defined inside a loop: each iteration makes a new one, and compiles a new program for it."""

from __future__ import annotations

import types
import weakref
from typing import Any

from jaxveh._core.errors import warn

TURNS = 5
"""This many functions from one place in the source are taken for a loop."""

_counts: dict[types.CodeType, int] = {}
_seen: weakref.WeakSet = weakref.WeakSet()


def note_function(who: str, function: Any) -> None:
    """Warn (`JaxvehWarning`), once per place, if `who` is called with new functions from the same line of the source."""
    if not isinstance(function, types.FunctionType) or function in _seen:
        return
    _seen.add(function)
    code = function.__code__
    _counts[code] = _counts.get(code, 0) + 1
    if _counts[code] == TURNS:
        warn(
            f"{who}: {function.__name__} of {code.co_filename}, line {code.co_firstlineno}, is a new function at each call, "
            f"{TURNS} so far, and each compiles a new program. Define it once, outside of the loop, and pass what varies as "
            "an array."
        )
