"""Numbers in text files: plain decimal numbers, and none of the other forms that Python accepts."""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?\s*")


def decimal(text: str) -> float:
    """Return the finite number of a text in decimal digits, such as `-1.5` or `2e-3`.

    **Raises** `ValueError` for other texts that `float` accepts: `nan`, `inf`, `1e400`, `1_000`, digits of other scripts.
    """
    number = float(text) if _DECIMAL.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise ValueError(f"{text!r} is not a finite decimal number")
    return number


def is_number(text: str) -> bool:
    """Whether Python accepts a text as a number, `nan` and `inf` included: it is data and not a heading."""
    try:
        float(text)
    except ValueError:
        return False
    return True
