"""Numbers of arrays as a person would write them."""

from __future__ import annotations

from typing import Any

import numpy as np


def plain_float(value: Any) -> float:
    """The Python float with the fewest digits that the array's own type reads as `value`: 1.6 for float32's 1.600000023841858."""
    return float(str(np.asarray(value)[()]))
