"""A sweep in short: which values and points to show, in which units, and the ranks of the choices."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from jaxveh.io import kit
from jaxveh.sweeps import Axis, Swept

ERRORS = ("rmse", "worst", "crps", "final", "error")
"""Values with these prefixes are errors, for which smaller is better: they are compared in pairs and ranked."""

SHOWN = {"rad": ("°", 180 / math.pi), "rad/s": ("°/s", 180 / math.pi)}
"""Units that readers expect instead, with the factors of conversion."""


class Shown(NamedTuple):
    """How a value or an axis is shown: its `label` with the unit, and the `factor` for its numbers."""

    label: str
    factor: float


def display_of(found: Swept, name: str) -> Shown:
    """How a value or an axis is shown."""
    unit, factor = SHOWN.get(found.unit(name), (found.unit(name), 1.0))
    return Shown(name if unit == "-" else f"{name} [{unit}]", factor)


def plain_values(found: Swept, names: Iterable[str] = ()) -> list[str]:
    """The values that are one number per run; only those of `names` if some are given.

    **Raises** `InputError` for an unknown name.
    """
    dims = len(found.design.axes) + 1
    there = [name for name in found.values if np.ndim(found.values[name]) == dims]
    for name in names:
        kit.check_known("sweep", "value", name, there)
    return list(names) or there


def errors_of(found: Swept, names: Iterable[str]) -> list[str]:
    """Those of `names` that are errors."""
    return [name for name in names if name.split(".")[0] in ERRORS]


def baseline_of(found: Swept, name: str) -> str | None:
    """The name of the error of doing nothing that belongs to an rmse; None if there is none."""
    kind, _, quantity = name.partition(".")
    nothing = f"baseline.{quantity}"
    return nothing if kind == "rmse" and nothing in found.values else None


def at_front(found: Swept, name: str, axes: Iterable[Axis]) -> np.ndarray:
    """A value's numbers (in the shown unit) with these axes in front and everything else in one last axis: (axes..., runs)."""
    return _in_front(found, np.asarray(found[name], float) * display_of(found, name).factor, axes)


def _in_front(found: Swept, values: np.ndarray, axes: Iterable[Axis]) -> np.ndarray:
    order = [found.design.axes.index(axis) for axis in axes]
    front = np.moveaxis(values, order, range(len(order)))
    return front.reshape(*front.shape[: len(order)], -1)


def computed_runs(found: Swept) -> np.ndarray:
    """Which runs are computed. A store that is half done has NaN in the others, which have not lost: a choice of which nothing is
    computed yet would be the worst of all.

    A study says of each run whether it `failed`. Of other sweeps a seed counts as computed for a choice if some number of its
    runs is known, since a run that is lost may have none.
    """
    if "failed" in found.values:
        return ~np.isnan(np.asarray(found["failed"], float))
    known = np.logical_or.reduce([~np.isnan(np.asarray(found[name], float)) for name in plain_values(found)])
    points = tuple(i for i, axis in enumerate(found.design.axes) if axis not in found.design.choices)
    return np.broadcast_to(known.any(axis=points, keepdims=True), known.shape)


def quartiles(values: np.ndarray) -> np.ndarray:
    """(3, ...): lower quartile, median and upper quartile along the last axis; non-finite numbers count as the largest."""
    values = np.where(np.isfinite(values), values, np.inf)
    return np.quantile(values, [0.25, 0.5, 0.75], axis=-1, method="nearest")


class Ranks(NamedTuple):
    """The ranks of the labels of an axis over all pairs of runs: the `mean` rank (1 is best), and the `shares` (labels,
    places) of coming first, second, ...; equal runs share their places."""

    labels: tuple[str, ...]
    mean: np.ndarray
    shares: np.ndarray


def ranks(found: Swept, name: str, axis: Axis) -> Ranks:
    """The ranks of the labels of an axis by an error on the same runs; a run that is not finite comes last.

    Runs that are not computed for each label do not count; if there are no others, the ranks are NaN.
    """
    there = _in_front(found, computed_runs(found), [axis]).all(axis=0)
    values = at_front(found, name, [axis])[:, there]
    if not there.any():
        return Ranks(tuple(map(str, axis.labels)), np.full(len(values), np.nan), np.zeros((len(values), len(values))))
    values = np.where(np.isfinite(values), values, np.inf)
    count = len(values)
    below = np.stack([(values < one).sum(axis=0) for one in values])
    same = np.stack([(values == one).sum(axis=0) for one in values])
    mean = (below + 0.5 * (same + 1)).mean(axis=-1)
    place = np.arange(count)[:, None, None]
    inside = (place >= below) & (place < below + same)
    shares = np.moveaxis((inside / same).mean(axis=-1), 0, 1)
    return Ranks(tuple(map(str, axis.labels)), mean, shares)


def label(value: Any) -> str:
    """A label of an axis as text."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
