"""Spans of time, `((start, end), ...)` in s, including the start but not the end."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.time_order import SAME_INSTANT


def as_spans(spans) -> tuple[tuple[float, float], ...]:
    """Spans as a static tuple of pairs of floats; a single pair is one span. What is none is left to `check_spans`."""
    try:
        pairs = tuple(spans)
        if len(pairs) == 2 and not any(hasattr(end, "__len__") for end in pairs):
            pairs = (pairs,)
        return tuple(tuple(float(end) for end in span) for span in pairs)  # type: ignore[misc]
    except (TypeError, ValueError):
        return spans


def check_spans(name: str, spans) -> None:
    """Raise `InputError` unless every span is a pair with a finite start before its end."""
    for span in spans if isinstance(spans, tuple) else (spans,):
        if not isinstance(span, tuple) or len(span) != 2 or not (math.isfinite(span[0]) and span[0] < span[1]):
            raise InputError(f"{name} = {span}: must be pairs (start, end) in s, with start before end.")


def since(times: jax.Array, start: Any) -> jax.Array:
    """Whether each time is at or after `start`."""
    return times - jnp.asarray(start, times.dtype) >= -SAME_INSTANT


def inside(times: jax.Array, spans) -> jax.Array:
    """Whether each time lies in one of the spans."""
    found = jnp.zeros(times.shape, bool)
    for start, end in spans:
        found = found | (since(times, start) & ~since(times, end))
    return found
