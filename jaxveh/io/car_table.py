"""A car file as a table: key, value, unit."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from jaxveh._core.labelled import PARAMETER, Labelled, Variable
from jaxveh._core.overview import Overview, number
from jaxveh._core.shown import Shown


class CarTable(Shown):
    """Shows a car file as a table of its values with units; positions and tyres are split into single numbers."""

    __slots__ = ()

    drawn_by = "car"

    def _told(self) -> dict[str, tuple[Any, str]]:
        """Return every value of the file, with its unit, by name."""
        found: dict[str, tuple[Any, str]] = {}
        for one in fields(self):  # type: ignore[arg-type]
            value, unit = getattr(self, one.name), one.metadata.get("unit", "")
            if is_dataclass(value):
                parts = [(part, getattr(value, part.name)) for part in fields(value)]
                found |= {f"{one.name}.{p.name}": (v, p.metadata.get("unit", "")) for p, v in parts if v is not None}
            elif isinstance(value, tuple):
                found |= {f"{one.name}[{k}]": (part, unit) for k, part in enumerate(value)}
            elif value is not None:
                found[one.name] = (value, unit)
        return found

    def _overview(self) -> Overview:
        words = lambda value: value if isinstance(value, str) else number(value)
        rows = [(name, words(value), unit or "-") for name, (value, unit) in self._told().items()]
        return Overview(
            f"{type(self).__name__}: {getattr(self, 'name', None) or 'a car'}", ("key", "value", "unit"), rows
        )

    def _labelled(self) -> Labelled:
        told = {name: one for name, one in self._told().items() if not isinstance(one[0], str)}
        names = Variable((PARAMETER,), np.array(list(told), object))
        units = Variable((PARAMETER,), np.array([unit or "-" for _, unit in told.values()], object))
        value = Variable((PARAMETER,), np.array([float(value) for value, _ in told.values()]))
        source = getattr(self, "name", None) or ""
        return Labelled(type(self).__name__, {"value": value}, {PARAMETER: names, "unit": units}, ("value",), source)
