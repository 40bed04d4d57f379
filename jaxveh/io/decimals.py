"""Numbers in text files: what a person would call one, and nothing else that Python takes for one."""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?\s*")


def decimal(text: str) -> float:
    """The finite number that a text holds in decimal digits, such as `-1.5` or `2e-3`.

    **Raises** `ValueError` for all else that `float` takes: `nan`, `inf`, `1e400`, `1_000`, digits of other scripts.
    """
    number = float(text) if _DECIMAL.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise ValueError(f"{text!r} is no finite decimal number")
    return number


def is_number(text: str) -> bool:
    """Whether Python takes a text for a number, `nan` and `inf` included: data, and no heading."""
    try:
        float(text)
    except ValueError:
        return False
    return True
