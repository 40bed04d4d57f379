"""What computes on the host, with NumPy, refuses traced numbers by name; jax's own error names no remedy."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

from jaxveh._core.errors import InputError, is_concrete

Function = TypeVar("Function", bound=Callable)

AFTER = "Call it outside of them, with known numbers or with what they return."
"""What to do with a function that looks at results."""

POSE = (
    "Make the problem outside of them with fitting.pose_rig, put traced numbers into it (eqx.tree_at(lambda p: p.measured, "
    "problem, ...)), and call fitting.solve."
)
"""What to do with a fit of rig data."""


def check_on_host(who: str, *values: Any, advice: str = POSE) -> None:
    """Raise `InputError` for traced numbers in what runs on the host, as a fit of rig data does; `advice`
    says what to do."""
    if not is_concrete(values):
        raise InputError(f"{who}: is given numbers that jit, vmap or grad traces, and runs on the host. {advice}")


def on_host(function: Function) -> Function:
    """A decorator of a function that looks at results on the host: it refuses traced numbers in any argument by name."""

    @functools.wraps(function)
    def of_known(*arguments, **named):
        check_on_host(function.__name__, arguments, named, advice=AFTER)
        return function(*arguments, **named)

    return of_known  # pyright: ignore[reportReturnType]
