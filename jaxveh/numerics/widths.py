"""Numbers beside arrays."""

from typing import Any


def as_wide_as(value: Any, other: Any) -> Any:
    """`value` in the shape and precision that it has together with `other`; NaN where `other` is not finite.

    A number beside an array becomes an array, as the fields of a state and the columns of a table must be.
    """
    return value + 0.0 * other
