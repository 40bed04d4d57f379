"""Estimated, fitted and bounded parameters: values by the parameters' names in the car."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.labelled import PARAMETER, Labelled, Variable, array_again
from jaxveh._core.overview import Lazy, Overview, number
from jaxveh._core.shown import Kept


@jtu.register_pytree_with_keys_class
class Parameters(Kept, Mapping):
    """Values by a parameter's name, in the order of `where`: a mapping, and a pytree with one leaf per parameter.

        found["front.B"]        by name
        found.front.B           the same, as in the car
        found.front             those of the front axle: again `Parameters`, as `found["front"]`
        found.array()           all in one array, (p, ...)

    The function that returns them defines the values: estimates (T,), fitted numbers, standard deviations, bounds.

    A parameter with the name of a method (`plot`, `save`, ...) is accessible only as `["plot"]`.

    **Raises** `KeyError` (by name) or `AttributeError` for an unknown parameter, with a list of the known ones.
    """

    __slots__ = ("_values",)

    drawn_by = "fit"

    def __init__(self, values: Mapping[str, Any]):
        self._values = dict(values)

    def __getitem__(self, name: str) -> Any:
        if name in self._values:
            return self._values[name]
        part = {one.removeprefix(f"{name}."): v for one, v in self._values.items() if one.startswith(f"{name}.")}
        if not part:
            raise KeyError(self._without(name))
        return Parameters(part)

    def __getattr__(self, name: str) -> Any:
        # Only names that are not found otherwise come here; `copy` and `pickle` call it before there are values.
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError:
            raise AttributeError(self._without(name)) from None

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def plot(self, truth: Mapping[str, Any], *arguments: Any, **options: Any) -> Any:
        """Draw their distance from a `truth` with the same names (`plots.fit`). **Returns** the figure."""
        return super().plot(truth, *arguments, **options)

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with a row per parameter: `parameter` and `value`; arrays have a row per element."""
        return super().to_pandas()

    @classmethod
    def from_pandas(cls, frame: Any) -> Parameters:
        """Make the parameters from a data frame with the columns `parameter` and `value`, one number each.

        **Raises** `InputError` for a frame without these columns, or with a duplicate name.
        """
        lost = [name for name in ("parameter", "value") if name not in getattr(frame, "columns", ())]
        if lost:
            raise InputError(f"Parameters.from_pandas: no column {', '.join(map(repr, lost))}.")
        names = [str(name) for name in frame["parameter"]]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"Parameters.from_pandas: {', '.join(twice)} occurs twice: must be one row per parameter.")
        return cls(dict(zip(names, jnp.asarray(frame["value"].to_numpy()), strict=True)))

    def stack(self) -> np.ndarray | None:
        """Return the values in one array (p, ...) of NumPy; None if kinds, shapes or types differ, or there are no values."""
        values = list(self._values.values())
        kinds = {(kind_of(value), np.shape(value), np.asarray(value).dtype) for value in values}
        return np.stack([np.asarray(value) for value in values]) if len(kinds) == 1 else None

    def _labelled(self) -> Labelled:
        stacked, name = self.stack(), Variable((PARAMETER,), np.array(list(self), object))
        facts = {"names": list(self), "kinds": [kind_of(value) for value in self.values()]}
        if stacked is not None:
            dims = tuple(f"value_{k}" for k in range(stacked.ndim - 1))
            variables = {"value": Variable((PARAMETER, *dims), stacked)}
        else:
            arrays = {name: np.asarray(value) for name, value in self.items()}
            dims = {name: tuple(f"{name}_{k}" for k in range(array.ndim)) for name, array in arrays.items()}
            variables = {name: Variable(dims[name], array) for name, array in arrays.items()}
        return Labelled("Parameters", variables, {PARAMETER: name}, tuple(variables), "", facts)

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Parameters:
        names, kinds, variables = labelled.facts["names"], labelled.facts["kinds"], labelled.both
        # A parameter may itself be named `value`, with another one beside it.
        is_stacked = len(variables) == 2 and PARAMETER in variables["value"].dims if "value" in variables else False
        of = lambda k, name: variables["value"].values[k] if is_stacked else variables[name].values
        return cls(
            {name: value_again(of(k, name), kind) for k, (name, kind) in enumerate(zip(names, kinds, strict=True))}
        )

    def _overview(self) -> Overview:
        row = lambda name: (name, number(self._values[name]))
        return Overview(f"Parameters: {len(self)}", ("parameter", "value"), Lazy(list(self), row))

    def __reduce__(self):
        return Parameters, (self._values,)

    def array(self) -> Any:
        """Return the values in one array, (p, ...), in their order."""
        values = list(self._values.values())
        return (jnp if any(isinstance(value, jax.Array) for value in values) else np).stack(values)

    def tree_flatten_with_keys(self):
        """Return the leaves with their names."""
        return [(jtu.DictKey(name), value) for name, value in self._values.items()], tuple(self._values)

    @classmethod
    def tree_unflatten(cls, names: tuple[str, ...], values) -> Parameters:
        """Return parameters of the same names with other values."""
        return cls(dict(zip(names, values, strict=True)))

    def _without(self, name: str) -> str:
        return f"no parameter {name!r}; there are: {', '.join(self._values) or 'none'}"


PLAIN = {"bool": bool, "int": int, "float": float}


def kind_of(value: Any) -> str:
    """Return the kind of a number or an array."""
    if isinstance(value, jax.Array):
        return "jax"
    return (
        type(value).__name__
        if type(value) in PLAIN.values()
        else "scalar"
        if isinstance(value, np.generic)
        else "numpy"
    )


def value_again(values: Any, kind: str) -> Any:
    """Return a value of this kind."""
    if kind in PLAIN:
        return PLAIN[kind](values)
    return np.asarray(values)[()] if kind == "scalar" else array_again(np.asarray(values), kind == "jax")
