"""Results as arrays with named dimensions: what data frames, xarray, files and pictures are made of, and results of again.

A result says once what it has, as `Labelled`; whoever shows or writes it knows no more of it than that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError

RUN, TIME, ROW, PARAMETER = "run", "time", "row", "parameter"
"""Names of dimensions: of a batch, of instants that all runs share, of rows of runs with instants of their own, of parameters."""


class Variable(NamedTuple):
    """An array with a name for each of its `dims`, and its unit, "" where none is known."""

    dims: tuple[str, ...]
    values: Any
    unit: str = ""


class Labelled(NamedTuple):
    """A result of a `kind` (its class's name): `variables` and `coordinates` by name; `shown`: the variables that a table for
    people has; `source`: where it came from; `facts`: what else is needed to make it again, plain values."""

    kind: str
    variables: dict[str, Variable]
    coordinates: dict[str, Variable]
    shown: tuple[str, ...]
    source: str = ""
    facts: dict[str, Any] = {}  # noqa: RUF012  nobody writes into it

    @property
    def both(self) -> dict[str, Variable]:
        """Coordinates and variables by name."""
        return {**self.coordinates, **self.variables}


def array_again(values: Any, is_jax: bool) -> Any:
    """An array of its own precision: on the host where jax would not keep it."""
    values = np.asarray(values)
    keeps = jax.dtypes.canonicalize_dtype(values.dtype) == values.dtype
    return jnp.asarray(values) if is_jax and keeps else values


def time_axis(time: Any, lead: int) -> tuple[tuple[str, ...], Variable, dict[str, Any]]:
    """The dimensions of what has a value an instant in each of a batch of `lead` dimensions, the coordinate `time`, and what is
    to be remembered of its shape: of a batch whose runs have the same instants they are kept once."""
    values, runs = np.asarray(time), run_axes(lead)
    facts = {"time": values.shape[:-1], "jax": isinstance(time, jax.Array)}
    first = values.reshape(-1, values.shape[-1])[0]
    if values.ndim == 1 or (values == first).all():
        return (*runs, TIME), Variable((TIME,), first, "s"), facts
    return (*runs, ROW), Variable((*runs, ROW), values, "s"), facts


def time_again(labelled: Labelled) -> Any:
    """The time that `time_axis` was given."""
    time, facts = labelled.both.get(TIME), labelled.facts
    if time is None:
        raise InputError("time is missing.")
    values = np.asarray(time.values)
    if values.ndim == 1:
        values = np.array(np.broadcast_to(values, (*facts["time"], values.shape[-1])))
    return array_again(values, facts["jax"])


def run_axes(lead: int) -> tuple[str, ...]:
    """The names of the dimensions of a batch."""
    return tuple(RUN if k == 0 else f"{RUN}_{k}" for k in range(lead))


def make_again(kind: type, fields: Mapping[str, Any]) -> Any:
    """An equinox module of these fields as they are, as unflattening makes it: a batch passes no check of one run."""
    made = object.__new__(kind)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made
