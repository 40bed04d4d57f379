"""Estimated, fitted and bounded parameters: values by name, as in the car, whoever made them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np


@jtu.register_pytree_with_keys_class
class Parameters(Mapping):
    """Values by a parameter's name, in the order of `where`: a mapping, and a pytree with one leaf a parameter.

        found["front.B"]        by name
        found.front.B           the same, as in the car
        found.front             those of the front axle: `Parameters` again, as `found["front"]`
        found.array()           all in one array, (p, ...)

    What the values are is said where they are returned: estimates (T,), fitted numbers, standard deviations, bounds.

    **Raises** `KeyError` (by name) or `AttributeError` for what is not there, with what is.
    """

    __slots__ = ("_values",)

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
        # Only what is not found otherwise comes here; `copy` and `pickle` ask before there are values.
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

    def __repr__(self) -> str:
        return f"Parameters({self._values!r})"

    def __reduce__(self):
        return Parameters, (self._values,)

    def array(self) -> Any:
        """The values in one array, (p, ...), in their order."""
        values = list(self._values.values())
        return (jnp if any(isinstance(value, jax.Array) for value in values) else np).stack(values)

    def tree_flatten_with_keys(self):
        """The leaves with their names."""
        return [(jtu.DictKey(name), value) for name, value in self._values.items()], tuple(self._values)

    @classmethod
    def tree_unflatten(cls, names: tuple[str, ...], values) -> Parameters:
        """The same names with other values."""
        return cls(dict(zip(names, values, strict=True)))

    def _without(self, name: str) -> str:
        return f"no parameter {name!r}; there are: {', '.join(self._values) or 'none'}"
