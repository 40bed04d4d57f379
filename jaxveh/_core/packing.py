"""Conversion of trees of arrays to variables with named dimensions, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.labelled import PARAMETER, ROW, RUN, TIME, Variable, array_again
from jaxveh._core.names import record_type
from jaxveh._core.parameters import Parameters, kind_of, value_again


class Packing:
    """Puts trees of arrays into `variables` and `coordinates`.

    `add` returns a plan (plain values) from which `unpack` makes the tree again.
    """

    def __init__(self) -> None:
        self.variables: dict[str, Variable] = {}
        self.coordinates: dict[str, Variable] = {}

    def add(self, tree: Any, name: str, lead: tuple[str, ...], *, suffix: str = "", inside: str | None = None) -> Any:
        """Add a tree whose leaves begin with the dimensions `lead`, and return its plan.

        The variable of a NamedTuple's field is named `inside` + field + `suffix`, by default `name.field`.
        """
        stem = f"{name}." if inside is None else inside
        if tree is None:
            return None
        if isinstance(tree, Parameters):
            return self._parameters(tree, name, lead)
        if hasattr(tree, "_asdict"):
            # Deeper levels have their full names.
            parts = {field: self.add(one, f"{stem}{field}{suffix}", lead) for field, one in tree._asdict().items()}
            return {"record": type(tree).__name__, "fields": parts}
        if isinstance(tree, Mapping):
            return {"mapping": {str(key): self.add(one, f"{stem}{key}{suffix}", lead) for key, one in tree.items()}}
        if type(tree) in (bool, int, float, str):
            return {"plain": tree}
        values = np.asarray(tree)
        taken = self._free(name)
        more = tuple(f"{taken}_{k}" for k in range(values.ndim - len(lead)))
        self.variables[taken] = Variable((*lead, *more)[: values.ndim], values)
        return {"jax" if isinstance(tree, jax.Array) else "scalar" if isinstance(tree, np.generic) else "numpy": taken}

    def _parameters(self, tree: Parameters, name: str, lead: tuple[str, ...]) -> Any:
        stacked = tree.stack()
        if stacked is None:
            return {"parameters": {one: self.add(value, f"{name}.{one}", lead) for one, value in tree.items()}}
        taken, values = self._free(name), np.moveaxis(stacked, 0, -1)
        more = tuple(f"{taken}_{k}" for k in range(values.ndim - 1 - len(lead)))
        self.variables[taken] = Variable((*(*lead, *more)[: values.ndim - 1], PARAMETER), values)
        self.coordinates[PARAMETER] = Variable((PARAMETER,), np.array(list(tree), object))
        return {"stacked": taken, "names": list(tree), "kind": kind_of(next(iter(tree.values())))}

    def _free(self, name: str) -> str:
        while name in self.variables or name in (RUN, TIME, ROW, PARAMETER):
            name = f"{name}_"
        return name


def unpack(plan: Any, variables: Mapping[str, Variable], kinds: Mapping[str, Any] | None = None) -> Any:
    """Make the tree of a plan; NamedTuples are of the class in `kinds` with their name, otherwise of `record_type`.

    **Raises** `InputError` for a missing variable.
    """
    if plan is None:
        return None
    if "plain" in plan:
        return plan["plain"]
    again = lambda part: unpack(part, variables, kinds)
    if "stacked" in plan:
        values = np.moveaxis(_find(variables, plan["stacked"]), -1, 0)
        return Parameters(
            {name: value_again(one, plan["kind"]) for name, one in zip(plan["names"], values, strict=True)}
        )
    if "parameters" in plan:
        return Parameters({name: again(part) for name, part in plan["parameters"].items()})
    if "mapping" in plan:
        return {name: again(part) for name, part in plan["mapping"].items()}
    if "record" in plan:
        fields = {name: again(part) for name, part in plan["fields"].items()}
        kind = (kinds or {}).get(plan["record"]) or record_type(plan["record"], fields)
        return kind(**fields)
    kind, name = next(iter(plan.items()))
    found = _find(variables, name)
    return found[()] if kind == "scalar" else array_again(found, kind == "jax")


def _find(variables: Mapping[str, Variable], name: str) -> np.ndarray:
    if name not in variables:
        raise InputError(f"{name} is missing; there are: {', '.join(variables)}.")
    return np.asarray(variables[name].values)
