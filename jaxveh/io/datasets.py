"""Results as datasets of xarray and data frames of pandas, and datasets as results."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, word_for
from jaxveh._core.labelled import Labelled, Variable
from jaxveh._core.version import VERSION
from jaxveh.io.optional import require

TOLD = "jaxveh"
"""The attribute that holds the facts from which a dataset becomes a result again."""


def facts_as_text(labelled: Labelled) -> str:
    """Return kind, version and facts as JSON, for a file's attribute."""
    return json.dumps(
        {"kind": labelled.kind, "version": VERSION, "shown": labelled.shown, "facts": labelled.facts}, default=_of_numpy
    )


def _of_numpy(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else list(value)


def arrays_of_text(
    text: Any, variables: dict[str, Variable], coordinates: dict[str, Variable], source: str, what: str
) -> Labelled:
    """Return the result of a text of `facts_as_text` with its arrays. **Raises** `InputError` for any other text."""
    try:
        content = json.loads(text)
        return Labelled(content["kind"], variables, coordinates, tuple(content["shown"]), source, content["facts"])
    except (TypeError, ValueError, KeyError) as error:
        raise InputError(f"{what}: its attribute {TOLD} is damaged ({error}).") from error


def dataset_of(labelled: Labelled) -> Any:
    """Return an `xarray.Dataset`; units are attributes `units` of the variables, `kind` and `source` those of the dataset."""
    xarray = require("xarray", "making a dataset")
    array = lambda one: (one.dims, np.asarray(one.values), {"units": one.unit} if one.unit else {})
    return xarray.Dataset(
        {name: array(one) for name, one in labelled.variables.items()},
        {name: array(one) for name, one in labelled.coordinates.items()},
        {"kind": labelled.kind, "source": labelled.source, TOLD: facts_as_text(labelled)},
    )


def of_dataset(kind: type, dataset: Any) -> Any:
    """Return the result of a `kind` from its dataset of `dataset_of`. **Raises** `InputError` for the dataset of another kind."""
    xarray = require("xarray", "reading a dataset")
    if not isinstance(dataset, xarray.Dataset):
        raise InputError(f"{kind.__name__}.from_xarray: {word_for(dataset)}: must be an xarray.Dataset.")
    return result_of(kind, arrays_of_dataset(dataset, f"{kind.__name__}.from_xarray"), f"{kind.__name__}.from_xarray")


def arrays_of_dataset(dataset: Any, what: str) -> Labelled:
    """Return a dataset's arrays with its facts; the kind of a dataset from another program is empty."""
    variable = lambda one: Variable(one.dims, _plain(one.values), str(one.attrs.get("units", "")))
    variables = {str(name): variable(one) for name, one in dataset.data_vars.items()}
    coordinates = {str(name): variable(one) for name, one in dataset.coords.items()}
    source = str(dataset.attrs.get("source", ""))
    if TOLD not in dataset.attrs:
        return Labelled("", variables, coordinates, (), source)
    return arrays_of_text(dataset.attrs[TOLD], variables, coordinates, source, what)


def _plain(values: np.ndarray) -> np.ndarray:
    """Return text arrays as arrays of objects, whatever type a library has given them."""
    return values.astype(object) if values.dtype.kind in "UT" else values


def result_of(kind: type, labelled: Labelled, what: str) -> Any:
    """Return the result of a kind. **Raises** `InputError` if it is of another kind, or something is missing."""
    of_strangers = labelled.kind == "" and kind.__name__ == "Recording"
    if labelled.kind != kind.__name__ and not of_strangers:
        found = f"of {labelled.kind}" if labelled.kind else f"from another program, without the attribute {TOLD}"
        raise InputError(f"{what}: must be of {kind.__name__}, but is {found}.")
    try:
        return kind._of_labelled(labelled)  # type: ignore[attr-defined]
    except InputError as error:
        raise InputError(f"{what}: {error}") from error
    except Exception as error:  # a damaged file: facts of another shape, arrays of another length
        raise InputError(f"{what}: is damaged ({type(error).__name__}: {error}).") from error


def frame_of(labelled: Labelled) -> Any:
    """Return a data frame of the displayed variables, with a row per place along the dimensions that they share.

    Their coordinates are the first columns. A variable with more dimensions becomes several columns, such as `name[0]`, or with
    the value of the coordinate in the brackets.
    """
    pandas = require("pandas", "making a data frame")
    shown = {name: labelled.both[name] for name in labelled.shown if name in labelled.both}
    first = next(iter(shown.values())).dims if shown else ()
    dims = tuple(d for d in first if all(d in one.dims for one in shown.values()))
    sizes = {d: n for one in shown.values() for d, n in zip(one.dims, np.shape(one.values), strict=True)}
    shape = tuple(sizes[d] for d in dims)
    columns: dict[str, Any] = {}
    of_dims = {name: one for name, one in labelled.coordinates.items() if one.dims and set(one.dims) <= set(dims)}
    for k, d in enumerate(dims):
        columns |= {name: _along(one, dims, shape) for name, one in of_dims.items() if one.dims[-1] == d}
        if d not in columns and not any(one.dims == (d,) for one in labelled.coordinates.values()):
            columns[d] = np.broadcast_to(
                np.arange(shape[k]).reshape([-1 if i == k else 1 for i in range(len(dims))]), shape
            )
    for name, one in shown.items():
        columns |= dict(_apart(name, one, dims, shape, labelled))
    frame = pandas.DataFrame({name: np.array(values).ravel() for name, values in columns.items()})
    units = {
        name: labelled.both[name].unit for name in frame.columns if name in labelled.both and labelled.both[name].unit
    }
    frame.attrs.update(units=units, source=labelled.source)
    return frame


def _along(one: Variable, dims: tuple[str, ...], shape: tuple[int, ...]) -> np.ndarray:
    """Broadcast a variable over all of the dimensions."""
    order = [d for d in dims if d in one.dims]
    values = np.transpose(np.asarray(one.values), [one.dims.index(d) for d in order])
    return np.broadcast_to(values.reshape([n if d in one.dims else 1 for d, n in zip(dims, shape, strict=True)]), shape)


def _apart(name: str, one: Variable, dims: tuple[str, ...], shape: tuple[int, ...], labelled: Labelled):
    """Yield the columns of a variable: one, or one for each place along the dimensions that the table does not have."""
    more = tuple(d for d in one.dims if d not in dims)
    if not more:
        yield name, _along(one, dims, shape)
        return
    values = np.moveaxis(np.asarray(one.values), [one.dims.index(d) for d in more], range(len(more)))
    rest = tuple(d for d in one.dims if d in dims)
    for place in np.ndindex(values.shape[: len(more)]):
        labels = [_label(labelled, d, k) for d, k in zip(more, place, strict=True)]
        yield f"{name}[{', '.join(labels)}]", _along(Variable(rest, values[place]), dims, shape)


def _label(labelled: Labelled, dim: str, place: int) -> str:
    known = labelled.coordinates.get(dim)
    return str(place) if known is None or known.dims != (dim,) else str(np.asarray(known.values)[place])
