"""Estimates of recordings by the program of a common length (`jaxveh._core.lengths`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp

from jaxveh._core.errors import is_concrete
from jaxveh._core.lengths import common_length, lengthen, lengthen_time, shorten
from jaxveh.statespace.model import Row


def of_common_length(program: Callable[..., Any], rows: Row, *given: Any) -> Any:
    """The estimate `program(*given, rows, count)` of these rows, which are filled up to a common length: recordings of similar
    length share one compiled program. The program must use the first `count` rows alone (None: all of them).

    Where a number of the rows or of `given` is traced, nothing is filled up.
    """
    if not is_concrete(rows, given):
        return program(*given, rows, None)
    count = len(rows.t)
    length = common_length(count)
    longer = Row(lengthen_time(rows.t, length), *lengthen((rows.u, rows.y), length))
    return _shorten_estimate(program(*given, longer, jnp.asarray(count)), count)


def _shorten_estimate(estimate: Any, count: int) -> Any:
    """An `Estimate` or a smoothed one with its first rows."""
    parts = {name: shorten(getattr(estimate, name), count) for name in ("time", *estimate.by_row)}
    if hasattr(estimate, "filtered"):
        parts["filtered"] = _shorten_estimate(estimate.filtered, count)
    return dataclasses.replace(estimate, **parts)
