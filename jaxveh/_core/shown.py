"""Methods that all results share: tables, files, figures, and the display in a terminal and a notebook.

Subpackages import only downwards, and optional libraries are used in certain subpackages only; yet `recording.plot()` is a method
of the recording, which is below all of them. So the methods in this module, and only here, find the function that does the work
by its name when they are called: nothing is imported before it is needed, and the subpackage that needs a missing library reports
it. A class describes itself as `Labelled` (for tables and files) and as an `Overview` (for display); it uses neither pandas nor
matplotlib.

The mixins have no fields, so that an equinox module with one of them remains the same tree for `jit`, `vmap` and `grad`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from typing import Any, ClassVar, Self

from jaxveh._core.labelled import Labelled
from jaxveh._core.overview import Overview, as_html, as_text


def above(room: str, name: str) -> Any:
    """Return the public object of a name in a higher subpackage, for a method in a lower one: `above("plots", "recording")`."""
    return getattr(importlib.import_module(f"jaxveh.{room}"), name)


class Shown:
    """Objects that are displayed: in a terminal, in a notebook, as a figure, as a table.

    A class has `_overview()`, `_labelled()`, and in `drawn_by` the name of its figure in `jaxveh.plots`.
    """

    __slots__ = ()

    drawn_by: ClassVar[str] = ""

    def _overview(self) -> Overview:
        raise NotImplementedError

    def _labelled(self) -> Labelled:
        raise NotImplementedError

    def __repr__(self) -> str:
        return self._as(as_text)

    def _repr_html_(self) -> str:
        """Return the overview as HTML for notebooks, without scripts and network access."""
        return self._as(as_html)

    def _as(self, form: Callable[[Overview], str]) -> str:
        # Whatever the object contains (tracers, shapes of a batch, values from a transformation), a message that shows it must
        # not fail.
        try:
            return form(self._overview())
        except Exception as error:
            return form(Overview(f"{type(self).__name__} that cannot be shown: {type(error).__name__}"))

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """Draw it with its function of `jaxveh.plots`, which takes the further arguments. **Returns** the figure."""
        return above("plots", self.drawn_by)(self, *arguments, **options)

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with a row per instant, parameter or run; units in `frame.attrs["units"]` or `unit`."""
        return above("io.kit", "frame_of")(self._labelled())

    def to_xarray(self) -> Any:
        """Return an `xarray.Dataset` with all values: dimensions by name, units and source as attributes."""
        return above("io.kit", "dataset_of")(self._labelled())


class Kept(Shown):
    """Objects that are displayed and can be stored, in xarray and in files, and read back.

    A class also has `_of_labelled(labelled)`, which makes an object from the result of `_labelled`.
    """

    __slots__ = ()

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Self:
        raise NotImplementedError

    @classmethod
    def from_xarray(cls, dataset: Any) -> Self:
        """Make it from a dataset of `to_xarray`, with all numbers and types unchanged.

        **Raises** `InputError` for a dataset of another kind.
        """
        return above("io.kit", "of_dataset")(cls, dataset)

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write it as `.nc` (NetCDF, which xarray opens) or `.parquet` (which pandas opens); `load` reads it back.

        The file is written completely or not at all. **Raises** `InputError` for another suffix, or if the file exists and
        `overwrite` is False.
        """
        above("io.kit", "save_result")(self, path, overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike) -> Self:
        """Read a file of `save`, with all numbers and types unchanged.

        **Raises** `InputError` for another suffix, a damaged file, or a file of another kind.
        """
        return above("io.kit", "load_result")(cls, path)
