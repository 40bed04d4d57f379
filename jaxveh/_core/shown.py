"""What results have in common for people: tables, files, pictures, and how they look in a terminal and a notebook.

Rooms import downwards only, and optional libraries stay in rooms of their own; yet `recording.plot()` belongs to the recording,
which stands below them all. So the methods here find what does the work by its name, when they are called, and in this module
alone: nothing is imported before somebody asks for it, and a missing library is told of by the room that needs it. A class says
what it is as `Labelled` (for tables and files) and as an `Overview` (for people); it knows neither pandas nor matplotlib.

The mixins have no fields, so that a module of equinox that takes one stays the same tree for `jit`, `vmap` and `grad`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from typing import Any, ClassVar, Self

from jaxveh._core.labelled import Labelled
from jaxveh._core.overview import Overview, as_html, as_text


def above(room: str, name: str) -> Any:
    """What a room lists under a name, for a method of a lower one: `above("plots", "recording")`."""
    return getattr(importlib.import_module(f"jaxveh.{room}"), name)


class Shown:
    """What is shown to people: in a terminal, in a notebook, as a figure, as a table.

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
        """The overview as HTML, for notebooks: no script, no network."""
        return self._as(as_html)

    def _as(self, form: Callable[[Overview], str]) -> str:
        # Whatever is inside (tracers, shapes of a batch, something that a transformation put there): a message that shows an
        # object must not fail because of it.
        try:
            return form(self._overview())
        except Exception as error:
            return form(Overview(f"{type(self).__name__} that cannot be shown: {type(error).__name__}"))

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """The figure of `jaxveh.plots` for it, with that function's further arguments. **Returns** the figure."""
        return above("plots", self.drawn_by)(self, *arguments, **options)

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`, a row for each instant, parameter or run; units in `frame.attrs["units"]`, or a column `unit`."""
        return above("io.kit", "frame_of")(self._labelled())

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with everything: dimensions by name, units and source as attributes."""
        return above("io.kit", "dataset_of")(self._labelled())


class Kept(Shown):
    """What is shown, and can be kept: in xarray and in files, and made of them again.

    A class has `_of_labelled(labelled)` as well, which makes one of what `_labelled` said.
    """

    __slots__ = ()

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Self:
        raise NotImplementedError

    @classmethod
    def from_xarray(cls, dataset: Any) -> Self:
        """What `to_xarray` made a dataset of, every number and type as it was.

        **Raises** `InputError` for a dataset of something else.
        """
        return above("io.kit", "of_dataset")(cls, dataset)

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write it as `.nc` (NetCDF, which xarray opens) or `.parquet` (which pandas opens); `load` gives it back.

        The file appears as a whole or not at all. **Raises** `InputError` for another suffix, or where the file exists and
        `overwrite` is False.
        """
        above("io.kit", "save_result")(self, path, overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike) -> Self:
        """What `save` wrote, every number and type as it was.

        **Raises** `InputError` for another suffix, a damaged file, or one of something else.
        """
        return above("io.kit", "load_result")(cls, path)
