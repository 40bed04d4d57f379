"""Functions that are written inside a loop: a new one at each turn, and with each a program that is compiled anew."""

from __future__ import annotations

import types
import warnings
import weakref
from typing import Any

from jaxveh._core.errors import JaxvehWarning

TURNS = 5
"""So many functions of one place in the source, each for a call of its own, are a loop."""

_seen: dict[types.CodeType, tuple[int, weakref.ref]] = {}


def note_function(who: str, function: Any) -> None:
    """Warn (`JaxvehWarning`), once a place, where `who` was given function after function from the same line of the source."""
    if not isinstance(function, types.FunctionType):
        return
    code = function.__code__
    count, last = _seen.get(code, (0, None))
    if last is not None and last() is function:
        return
    _seen[code] = (count + 1, weakref.ref(function))
    if count + 1 == TURNS:
        warnings.warn(
            f"{who}: {function.__name__} of {code.co_filename}, line {code.co_firstlineno}, is a new function at each call, "
            f"{TURNS} so far, and each compiles a program anew. Write it once, outside of the loop, and give it what varies as "
            "an array.",
            JaxvehWarning,
            stacklevel=3,
        )
