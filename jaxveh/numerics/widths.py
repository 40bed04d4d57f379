"""Numbers beside arrays."""

from typing import Any


def as_wide_as(value: Any, *others: Any) -> Any:
    """`value` in the shape and precision that it has together with the `others`; NaN where one of them is not finite.

    A number beside an array becomes an array, as the fields of a state and the columns of a table must be.
    """
    for other in others:
        value = value + 0.0 * other
    return value
