"""Cars and tyres as tables of their parameters: name, value, unit."""

from __future__ import annotations

from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxveh._core.labelled import PARAMETER, Labelled, Variable
from jaxveh._core.overview import Lazy, Overview, count_of, number
from jaxveh._core.parameter import Parameter, every_parameter
from jaxveh._core.shown import Shown


class WithParameters(Shown):
    """A module whose array leaves are parameters. `called`: its kind, in a word."""

    __slots__ = ()

    called = "model"

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with a row per parameter: `parameter`, `value` and `unit`."""
        return super().to_pandas()

    def _leaves(self) -> dict[str, tuple[Parameter, Any]]:
        """Return every parameter and its value by name, in the order of the tree."""
        values = {"".join(_word(step) for step in path): leaf for path, leaf in jtu.tree_flatten_with_path(self)[0]}
        return {name: (p, values[f".{p.path}"]) for name, p in every_parameter(self).items()}

    def _overview(self) -> Overview:
        leaves = self._leaves()
        title = f"{type(self).__name__}: {self.called}, {count_of(len(leaves), 'parameter')}"
        row = lambda name: (name, number(leaves[name][1]), leaves[name][0].unit)
        # Its own parameters before those of its parts.
        names = sorted(leaves, key=lambda name: name.count("."))
        return Overview(title, ("parameter", "value", "unit"), Lazy(names, row))

    def _labelled(self) -> Labelled:
        leaves = self._leaves()
        shapes = {np.shape(value) for _, value in leaves.values()}
        # A parameter that is an array (a curve over speed) has one row per number.
        flat = {}
        for name, (p, value) in leaves.items():
            array = np.asarray(value)
            places = [()] if len(shapes) <= 1 or not array.ndim else list(np.ndindex(array.shape))
            for place in places:
                index = f"[{', '.join(map(str, place))}]" if place else ""
                flat[name + index] = (array[place], p.unit)
        values = np.array([value for value, _ in flat.values()])
        more = tuple(f"value_{k}" for k in range(values.ndim - 1))
        name = Variable((PARAMETER,), np.array(list(flat), object))
        unit = Variable((PARAMETER,), np.array([unit for _, unit in flat.values()], object))
        return Labelled(
            type(self).__name__,
            {"value": Variable((PARAMETER, *more), values)},
            {PARAMETER: name, "unit": unit},
            ("value",),
        )


def _word(step: Any) -> str:
    return "." + str(getattr(step, "name", getattr(step, "key", getattr(step, "idx", step))))
