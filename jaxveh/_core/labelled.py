"""Results as arrays with named dimensions, the common form for data frames, xarray, files and figures, and back to results.

A result describes itself once, as `Labelled`; code that displays or writes a result uses nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError

RUN, TIME, ROW, PARAMETER = "run", "time", "row", "parameter"
"""Names of dimensions: a batch, instants common to all runs, rows of runs with their own instants, parameters."""


class Variable(NamedTuple):
    """An array with the names of its `dims`, and its unit, "" if unknown."""

    dims: tuple[str, ...]
    values: Any
    unit: str = ""


class Labelled(NamedTuple):
    """A result of a `kind` (the name of its class), as `variables` and `coordinates` by name.

    `shown`: the variables in a displayed table; `source`: its origin; `facts`: further plain values that are needed to make the
    result again.
    """

    kind: str
    variables: dict[str, Variable]
    coordinates: dict[str, Variable]
    shown: tuple[str, ...]
    source: str = ""
    facts: dict[str, Any] = {}  # noqa: RUF012  it is never written to

    @property
    def both(self) -> dict[str, Variable]:
        """Coordinates and variables by name."""
        return {**self.coordinates, **self.variables}


def array_again(values: Any, is_jax: bool) -> Any:
    """Return an array in its own precision; it stays on the host if JAX would not keep that precision."""
    values = np.asarray(values)
    keeps = jax.dtypes.canonicalize_dtype(values.dtype) == values.dtype
    return jnp.asarray(values) if is_jax and keeps else values


def time_axis(time: Any, lead: int) -> tuple[tuple[str, ...], Variable, dict[str, Any]]:
    """Return the dimensions of a batch over time, with `lead` dimensions before the time axis, its time coordinate, and facts.

    If all runs of a batch have the same instants, these are kept once; the facts record the original shape.
    """
    values, runs = np.asarray(time), run_axes(lead)
    facts = {"time": values.shape[:-1], "jax": isinstance(time, jax.Array)}
    first = values.reshape(-1, values.shape[-1])[0]
    if values.ndim == 1 or (values == first).all():
        return (*runs, TIME), Variable((TIME,), first, "s"), facts
    return (*runs, ROW), Variable((*runs, ROW), values, "s"), facts


def time_again(labelled: Labelled) -> Any:
    """Return the original time from the coordinate and the facts of `time_axis`."""
    time, facts = labelled.both.get(TIME), labelled.facts
    if time is None:
        raise InputError("time is missing.")
    values = np.asarray(time.values)
    if values.ndim == 1:
        values = np.array(np.broadcast_to(values, (*facts["time"], values.shape[-1])))
    return array_again(values, facts["jax"])


def run_axes(lead: int) -> tuple[str, ...]:
    """Return the names of the dimensions of a batch."""
    return tuple(RUN if k == 0 else f"{RUN}_{k}" for k in range(lead))


def make_again(kind: type, fields: Mapping[str, Any]) -> Any:
    """Make an equinox module with these fields without checks, as unflattening does: a batch would fail the checks of one run."""
    made = object.__new__(kind)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made
