"""The result of a sweep: arrays by name over the design's axes and the seeds."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, word_for
from jaxveh._core.labelled import Labelled, Variable
from jaxveh._core.names import check_names
from jaxveh._core.overview import Lazy, Overview, count_of, missing_share, span
from jaxveh._core.parameters import Parameters
from jaxveh._core.shown import Kept, above
from jaxveh.sweeps.design import Axis, Design
from jaxveh.sweeps.paired import Comparison, compare

SEED, OWN = "seed", "_of_"
"""The dimension of runs, and the middle part of the names of dimensions of a run's own value."""


@dataclasses.dataclass(frozen=True, repr=False)
class Swept(Kept):
    """`values` by name, each with the design's axes, then the `seeds`, then the axes of a run's own value.

    If runs return trees, such as an estimate's `parameters`, `found["parameters"]` is all of them as `Parameters`, and
    `found["parameters.front.B"]` is one of them; the same holds in `at`, `quantile` and the methods that use it. `units` by
    the names of values and axes, and a `note`, are those that `sweep` got.

    `to_xarray` gives the same as xarray does from a sweep's store: dimensions are the axes and `seed`. Read back, it has
    the labels of choices instead of the objects, as with `read_sweep`; `load` also opens stores (`.zarr`).
    """

    design: Design
    seeds: int
    values: Mapping[str, np.ndarray]
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    note: str = ""

    def unit(self, name: str) -> str:
        """The unit of a value or an axis; `-` if none was given."""
        return self.units.get(name, "-")

    def plot(self, value: str | None = None) -> Any:
        """The first figure of `studies.figures` for a value (default: the first error, or value). **Returns** the figure."""
        return next(above("studies.figures", "figures")(self, () if value is None else (value,)))[1]

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame` with one row per run: a column per axis, `seed`, and a column per value; a value with
        several numbers per run becomes several columns (`name[0]`)."""
        return super().to_pandas()

    @classmethod
    def load(cls, path: str | os.PathLike) -> Swept:
        """Read a file of `save`, or a sweep's store (`.zarr`) as `read_sweep` does."""
        if str(path).lower().rstrip("/").endswith(".zarr"):
            return above("sweeps", "read_sweep")(path)
        return super().load(path)

    def _labelled(self) -> Labelled:
        axes, coordinates = self.design.axes, {}
        for axis in axes:
            labels = np.array([str(label) for label in axis.labels], object) if axis.choice else np.asarray(axis.labels)
            coordinates[axis.name] = Variable((axis.name,), labels, self.units.get(axis.name, ""))
            for name, column in (axis.columns or {}).items():
                of = f"{axis.name}.{name}"
                coordinates[of] = Variable((axis.name,), np.asarray(column), self.units.get(of, ""))
        lead = (*(axis.name for axis in axes), SEED)
        variables = {}
        for name, values in self.values.items():
            array = np.asarray(values)
            more = tuple(f"{name}{OWN}{i}" for i in range(array.ndim - len(lead)))
            variables[name] = Variable((*lead, *more), array, self.units.get(name, ""))
        told = [
            {"name": axis.name, "labels": [_plain(label) for label in axis.labels], "choice": axis.choice,
             "columns": list(axis.columns or {})} for axis in axes
        ]  # fmt: skip
        facts = {"axes": told, "seeds": self.seeds, "units": dict(self.units)}
        return Labelled("Swept", variables, coordinates, tuple(variables), self.note, facts)

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Swept:
        design, facts, both = Design(), labelled.facts, labelled.both
        column = lambda axis, name: np.asarray(both[f"{axis['name']}.{name}"].values)
        columns = lambda axis: {name: column(axis, name) for name in axis["columns"]} or None
        design.axes = tuple(
            Axis(axis["name"], tuple(axis["labels"]), tuple(axis["labels"]), axis["choice"], columns(axis))
            for axis in facts["axes"]
        )
        values = {name: np.asarray(one.values) for name, one in labelled.variables.items()}
        return cls(design, facts["seeds"], values, facts["units"], labelled.source)

    def _overview(self) -> Overview:
        axes = [f"{axis.name} ({len(axis.labels)})" for axis in self.design.axes]
        title = f"Swept: {count_of(len(self.values), 'value')} over {' x '.join([*axes, count_of(self.seeds, 'seed')])}"
        title += f", {self.note!r}" if self.note else ""
        # A store's values are read on access, and may be larger than the memory.
        if not isinstance(self.values, dict):
            return Overview(title, ("value", "unit"), [(name, self.unit(name)) for name in self.values], 2)
        row = lambda name: (name, self.unit(name), *span(self.values[name]), missing_share(self.values[name]))
        return Overview(title, ("value", "unit", "least", "most", "missing"), Lazy(list(self.values), row), 2)

    def __getitem__(self, name: str) -> Any:
        """All values of this name, (axes..., seeds, ...), or `Parameters` of those whose names begin with it and a dot."""
        if not any(one == name or one.startswith(f"{name}.") for one in self.values):
            check_names("value", (name,), self.values)
        return Parameters(self.values)[name]

    def at(self, name: str, **where: Any) -> Any:
        """The values where axes have these labels: `found.at("rmse", filter="PF", noise=0.02)`; other axes are kept."""
        values, index = self[name], []
        for axis_name in where:
            self.design.axis(axis_name)
        for axis in self.design.axes:
            if axis.name not in where:
                index.append(slice(None))
                continue
            if where[axis.name] not in axis.labels:
                there = ", ".join(map(str, axis.labels))
                raise InputError(f"{axis.name} = {where[axis.name]!r}: the design has {there}.")
            index.append(axis.labels.index(where[axis.name]))
        return jax.tree.map(lambda one: one[tuple(index)], values)

    def quantile(self, name: str, share: float) -> Any:
        """The quantile over seeds: (axes..., ...). Runs that are not finite count as the largest."""
        return jax.tree.map(lambda values: _quantile(values, share, len(self.design.axes)), self[name])

    def median(self, name: str) -> Any:
        """The median over seeds."""
        return self.quantile(name, 0.5)

    def quartiles(self, name: str) -> tuple[Any, Any]:
        """The lower and the upper quartile over seeds."""
        return self.quantile(name, 0.25), self.quantile(name, 0.75)

    def compare(self, name: str, axis: str, a: Any, b: Any, *, level: float = 0.95) -> Comparison:
        """`a` against `b` along an axis, seed by seed, at every point of the others; see `sweeps.compare`."""
        return compare(
            self.at(name, **{axis: a}), self.at(name, **{axis: b}), axis=len(self.design.axes) - 1, level=level
        )


def _plain(label: Any) -> Any:
    """A label in the form of JSON."""
    return label if isinstance(label, bool | int | float | str) else str(label)


def _quantile(values: np.ndarray, share: float, axis: int) -> np.ndarray:
    values = np.where(np.isnan(values), np.inf, values)
    return np.quantile(values, share, axis=axis, method="linear" if np.isfinite(values).all() else "nearest")


def named_leaves(tree: Any) -> dict[str, Any]:
    """The leaves of a tree of mappings and NamedTuples by dotted names; the name of a lone leaf is empty."""
    pairs = jax.tree_util.tree_leaves_with_path(tree)
    return {".".join(_word(step) for step in path): leaf for path, leaf in pairs}


def _word(step: Any) -> str:
    for attribute in ("name", "key", "idx"):
        if hasattr(step, attribute):
            return str(getattr(step, attribute))
    return str(step)


def arrays_of(result):
    """The result's arrays. Raises `InputError` for anything else."""
    named = named_leaves(result)
    if not named or any(not name for name in named):
        raise InputError(
            f"run returned {word_for(result)}: must be a mapping or a NamedTuple of arrays, such as "
            '{"rmse": ..., "result": ...}.'
        )
    bad = [name for name, leaf in named.items() if not eqx.is_array_like(leaf)]
    if bad:
        raise InputError(f"run: {', '.join(bad)} in its result must be arrays.")
    return {name: jnp.asarray(leaf) for name, leaf in named.items()}
