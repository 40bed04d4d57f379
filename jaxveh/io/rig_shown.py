"""Display and storage of rig data."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np

from jaxveh._core.labelled import ROW, Labelled, Variable
from jaxveh._core.overview import Lazy, Overview, count_of, missing_share, span
from jaxveh._core.shown import Kept


class RigShown(Kept):
    """A table with arrays (n,) by name, in these `units`, and a `source`."""

    __slots__ = ()

    drawn_by = "rig"
    units: ClassVar[dict[str, str]] = {}

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with the rows of the table and a column per array; units are in `frame.attrs["units"]`."""
        return super().to_pandas()

    def _arrays(self) -> dict[str, np.ndarray]:
        return {name: values for name in self.units if (values := getattr(self, name)) is not None}

    def _labelled(self) -> Labelled:
        variables = {name: Variable((ROW,), values, self.units[name]) for name, values in self._arrays().items()}
        return Labelled(type(self).__name__, variables, {}, tuple(variables), getattr(self, "source", ""))

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Self:
        arrays = {name: np.asarray(one.values) for name, one in labelled.variables.items()}
        return cls(**arrays, source=labelled.source)  # type: ignore[call-arg]

    def _overview(self) -> Overview:
        arrays = self._arrays()
        rows = count_of(len(next(iter(arrays.values()))), "row")
        title = f"{type(self).__name__}: {rows}, {getattr(self, 'source', '')!r}"
        row = lambda name: (name, self.units[name] or "-", *span(arrays[name]), missing_share(arrays[name]))
        names = list(arrays)
        return Overview(
            title, ("channel", "unit", "least", "most", "missing"), Lazy(names, row), 2, Lazy(names, arrays.__getitem__)
        )
