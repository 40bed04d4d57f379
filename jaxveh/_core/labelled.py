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
from jaxveh._core.names import record_type
from jaxveh._core.parameters import Parameters

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


class Packing:
    """Puts trees of arrays into variables, and keeps a plan (plain values) by which `unpack` makes the trees again.

    `lead`: the names of the leading dimensions of the arrays that have them.
    """

    def __init__(self) -> None:
        self.variables: dict[str, Variable] = {}
        self.coordinates: dict[str, Variable] = {}

    def add(self, tree: Any, name: str, lead: tuple[str, ...], *, suffix: str = "", inside: str | None = None) -> Any:
        """The plan of a tree whose leaves begin with the dimensions `lead`. A field of a NamedTuple is `inside` + field +
        `suffix`; by default `name.field`."""
        stem = f"{name}." if inside is None else inside
        if tree is None:
            return None
        if isinstance(tree, Parameters):
            return self._parameters(tree, name, lead)
        if hasattr(tree, "_asdict"):
            # Deeper ones have their whole names.
            parts = {field: self.add(one, f"{stem}{field}{suffix}", lead) for field, one in tree._asdict().items()}
            return {"record": type(tree).__name__, "fields": parts}
        if isinstance(tree, Mapping):
            return {"mapping": {str(key): self.add(one, f"{stem}{key}{suffix}", lead) for key, one in tree.items()}}
        if isinstance(tree, bool | int | float | str):
            return {"plain": tree}
        values = np.asarray(tree)
        taken = self._free(name)
        more = tuple(f"{taken}_{k}" for k in range(values.ndim - len(lead)))
        self.variables[taken] = Variable((*lead, *more)[: values.ndim], values)
        return {"jax" if isinstance(tree, jax.Array) else "numpy": taken}

    def _parameters(self, tree: Parameters, name: str, lead: tuple[str, ...]) -> Any:
        values = list(tree.values())
        if (
            any(isinstance(value, bool | int | float) for value in values)
            or len({_kind(value) for value in values}) != 1
        ):
            return {"parameters": {one: self.add(value, f"{name}.{one}", lead) for one, value in tree.items()}}
        taken = self._free(name)
        stacked = np.stack([np.asarray(value) for value in values])
        more = tuple(f"{taken}_{k}" for k in range(stacked.ndim - 1 - len(lead)))
        self.variables[taken] = Variable((*lead, *more, PARAMETER)[: stacked.ndim], np.moveaxis(stacked, 0, -1))
        self.coordinates[PARAMETER] = Variable((PARAMETER,), np.array(list(tree), object))
        return {"stacked": taken, "names": list(tree), "jax": isinstance(values[0], jax.Array)}

    def _free(self, name: str) -> str:
        while name in self.variables or name in (RUN, TIME, ROW, PARAMETER):
            name = f"{name}_"
        return name


def _kind(value: Any) -> tuple:
    return isinstance(value, jax.Array), np.shape(value), np.result_type(value)


def unpack(plan: Any, variables: Mapping[str, Variable], kinds: Mapping[str, Any] | None = None) -> Any:
    """The tree of a plan; NamedTuples are of these `kinds` by name, else of `record_type`.

    **Raises** `InputError` for a variable that is not there.
    """
    if plan is None:
        return None
    if "plain" in plan:
        return plan["plain"]
    again = lambda part: unpack(part, variables, kinds)
    if "stacked" in plan:
        values = np.moveaxis(_find(variables, plan["stacked"]), -1, 0)
        return Parameters({name: _array(one, plan["jax"]) for name, one in zip(plan["names"], values, strict=True)})
    if "parameters" in plan:
        return Parameters({name: again(part) for name, part in plan["parameters"].items()})
    if "mapping" in plan:
        return {name: again(part) for name, part in plan["mapping"].items()}
    if "record" in plan:
        fields = {name: again(part) for name, part in plan["fields"].items()}
        kind = (kinds or {}).get(plan["record"]) or record_type(plan["record"], fields)
        return kind(**fields)
    is_jax = "jax" in plan
    return _array(_find(variables, plan["jax" if is_jax else "numpy"]), is_jax)


def _find(variables: Mapping[str, Variable], name: str) -> np.ndarray:
    if name not in variables:
        raise InputError(f"{name} is missing; there are: {', '.join(variables)}.")
    return np.asarray(variables[name].values)


def _array(values: Any, is_jax: bool) -> Any:
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
    return _array(values, facts["jax"])


def run_axes(lead: int) -> tuple[str, ...]:
    """The names of the dimensions of a batch."""
    return tuple(RUN if k == 0 else f"{RUN}_{k}" for k in range(lead))


def make_again(kind: type, fields: Mapping[str, Any]) -> Any:
    """An equinox module of these fields as they are, as unflattening makes it: a batch passes no check of one run."""
    made = object.__new__(kind)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made
