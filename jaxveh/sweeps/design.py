"""The design of a sweep: named axes of numbers and of choices."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_finite
from jaxveh._core.names import record
from jaxveh.sweeps.sampling import Samples, check_field_names


class Axis(NamedTuple):
    """One named axis of a design: the `labels` that its results carry, the `values` that `run` gets, and whether it is a
    `choice`.

    A choice (a filter, a manoeuvre, a function) is known at compile time: each has its own program. All numbers share one
    program. Samples are numbered; `columns` has their numbers by name, (n,) each, and `run` gets those of its own sample.
    """

    name: str
    labels: tuple[Any, ...]
    values: tuple[Any, ...]
    choice: bool
    columns: dict[str, np.ndarray] | None = None

    def at(self, which: np.ndarray) -> Any:
        """The numbers at these places; for samples by name."""
        if self.columns is None:
            return np.asarray(self.values, float)[which]
        return {name: np.asarray(column, float)[which] for name, column in self.columns.items()}


class Design:
    """Every combination of named axes.

        Design(noise=[0.001, 0.005, 0.02], filter={"PF": filters.ParticleFilter(1000), "UKF": filters.Unscented()})

    A sequence of numbers is an axis of numbers, which `run` gets as arrays of the default precision; a mapping from labels to
    objects is an axis of choices. `latin_hypercube` and `sobol` make an axis of samples, each with several numbers. Without axes
    there is one point.

    **Raises** `InputError` for a name that Python does not allow or that the seeds have (`seed`), an empty axis, numbers that are
    not finite, or a sequence of anything but numbers.
    """

    axes: tuple[Axis, ...]

    def __init__(self, **axes: Sequence[float] | Mapping[str, Any] | Samples):
        check_field_names("axis", axes)
        if "seed" in axes:
            raise InputError("axis seed: is the name of the seeds' own axis in every result; take another one.")
        self.axes = tuple(_axis(name, values) for name, values in axes.items())

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values of each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def choices(self) -> tuple[Axis, ...]:
        """The axes of choices."""
        return tuple(axis for axis in self.axes if axis.choice)

    @property
    def numbers(self) -> tuple[Axis, ...]:
        """The axes of numbers."""
        return tuple(axis for axis in self.axes if not axis.choice)

    def axis(self, name: str) -> Axis:
        """The axis of this name, or an `InputError` that lists the names."""
        for axis in self.axes:
            if axis.name == name:
                return axis
        there = ", ".join(axis.name for axis in self.axes) or "none"
        raise InputError(f"axis = {name!r}: the design has {there}.")

    def combinations(self) -> Iterator[tuple[tuple[int, ...], str, dict[str, Any]]]:
        """Each combination of choices: its place along the axes of choices, a description, and the objects by name."""
        for place in itertools.product(*(range(len(axis.values)) for axis in self.choices)):
            pairs = list(zip(self.choices, place, strict=True))
            said = ", ".join(f"{axis.name} {axis.labels[i]}" for axis, i in pairs)
            yield place, said, {axis.name: axis.values[i] for axis, i in pairs}

    def grid(self) -> dict[str, Any]:
        """Each axis of numbers at all their combinations, (P,), with samples by name; the last axis varies fastest."""
        axes = self.numbers
        meshes = np.meshgrid(*(np.arange(len(axis.values)) for axis in axes), indexing="ij") if axes else []
        return {axis.name: axis.at(mesh.ravel()) for axis, mesh in zip(axes, meshes, strict=True)}

    def point(self, numbers: Mapping[str, Any], choices: Mapping[str, Any]) -> Any:
        """The point that `run` gets: a NamedTuple with the axes' names, in their order."""
        both = {**numbers, **choices}
        for axis in self.axes:
            if axis.columns is not None:
                both[axis.name] = record("Sample", dict(both[axis.name]))
        return record("Point", {axis.name: both[axis.name] for axis in self.axes})


def _axis(name: str, values: Any) -> Axis:
    if isinstance(values, Samples):
        labels = tuple(range(len(next(iter(values.columns.values())))))
        axis = Axis(name, labels, labels, choice=False, columns=values.columns)
    elif isinstance(values, Mapping):
        axis = Axis(name, tuple(values), tuple(values.values()), choice=True)
    else:
        numbers = _numbers(name, values)
        axis = Axis(name, numbers, numbers, choice=False)
    if not axis.values:
        raise InputError(f"axis {name} is empty: give at least one value.")
    return axis


def _numbers(name: str, values: Any) -> tuple[float, ...]:
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        array = np.zeros((0, 0))
    if array.ndim != 1:
        raise InputError(
            f"axis {name} = {values!r}: must be a sequence of numbers, or a mapping from labels to choices."
        )
    check_finite(f"axis {name}", array)
    return tuple(float(number) for number in array)
