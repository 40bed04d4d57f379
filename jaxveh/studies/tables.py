"""Tables of a sweep: medians and quartiles by axis, paired comparisons, ranks."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np

from jaxveh._core.errors import check_kind
from jaxveh.studies.summary import (
    at_front,
    baseline_of,
    computed_runs,
    display_of,
    errors_of,
    label,
    plain_values,
    quartiles,
    ranks,
)
from jaxveh.sweeps import Axis, Comparison, Swept, Table, compare

MOST_POINTS = 40
"""Most rows of the table of every point: larger designs get only the table by axis."""

COMPARED = ("ratio", "95 % interval over seeds", "smaller in")


def tables(found: Swept, values: Iterable[str] = ()) -> list[Table]:
    """Every table of a sweep for these values (default: all that are one number per run)."""
    check_kind("tables: found", found, Swept, "sweeps.sweep and sweeps.read_sweep return one.")
    names = plain_values(found, values)
    made = [by_axis(found, names)]
    if 1 < int(np.prod([len(axis.labels) for axis in _listed(found)])) <= MOST_POINTS and len(_listed(found)) > 1:
        made.append(by_point(found, names))
    errors = errors_of(found, names)
    made += [one for one in (_against_nothing(found, errors),) if one.rows]
    for axis in (axis for axis in found.design.choices if len(axis.labels) > 1):
        if errors:
            made += [_pairs(found, errors, axis), _ranks(found, errors, axis)]
    return made


def by_axis(found: Swept, names: list[str]) -> Table:
    """Medians and quartiles at each label of each axis, over everything else; samples are shown only in figures."""
    rows = [("all", "", *(_cell(at_front(found, name, [])) for name in names))]
    for axis in _listed(found):
        factor = display_of(found, axis.name).factor
        for i, value in enumerate(axis.labels):
            cells = (_cell(at_front(found, name, [axis])[i]) for name in names)
            rows.append((display_of(found, axis.name).label if i == 0 else "", _label(value, factor), *cells))
    return Table("Median (lower to upper quartile) over everything else", ("axis", "", *_heads(found, names)), rows, 2)


def by_point(found: Swept, names: list[str]) -> Table:
    """Medians and quartiles at every point, over seeds and samples."""
    axes = _listed(found)
    columns = [at_front(found, name, axes) for name in names]
    rows = []
    for place in itertools.product(*(range(len(axis.labels)) for axis in axes)):
        where = [
            _label(axis.labels[i], display_of(found, axis.name).factor) for axis, i in zip(axes, place, strict=True)
        ]
        rows.append((*where, *(_cell(column[place]) for column in columns)))
    heads = (*(display_of(found, axis.name).label for axis in axes), *_heads(found, names))
    return Table("Median (lower to upper quartile) over seeds at every point", heads, rows, len(axes))


def compare_by_seed(a: np.ndarray, b: np.ndarray) -> Comparison:
    """Errors a against b (points..., seeds). Each seed counts with its geometric mean over all points, so that the intervals are
    those over seeds; `wins` are counted run by run. A run that is not finite has lost."""
    a, b = (np.where(np.isfinite(values), values, np.inf).reshape(-1, values.shape[-1]) for values in (a, b))
    with np.errstate(divide="ignore"):
        made = compare(*(np.exp(np.log(values).mean(axis=0)) for values in (a, b)))
    return made._replace(wins=np.where(a < b, 1.0, np.where(a == b, 0.5, 0.0)).mean())


def _against_nothing(found: Swept, errors: list[str]) -> Table:
    rows = []
    for name in errors:
        nothing = baseline_of(found, name)
        if nothing is not None and found.seeds > 1:
            whole = _whole(computed_runs(found))
            one, other = (np.asarray(found[value], float)[..., whole] for value in (name, nothing))
            rows.append((name, *_comparison(one, other)))
    return Table("Against doing nothing (baseline), on the same drives", ("error", *COMPARED), rows)


def _pairs(found: Swept, errors: list[str], axis: Axis) -> Table:
    """Each label of a choice against the first, seed by seed."""
    rows = []
    place = found.design.axes.index(axis)
    for name in errors if found.seeds > 1 else ():
        values, there = (
            np.moveaxis(all_of, place, 0) for all_of in (np.asarray(found[name], float), computed_runs(found))
        )
        for i in range(1, len(axis.labels)):
            whole = _whole(there[i] & there[0])
            rows.append((name, str(axis.labels[i]), *_comparison(values[i][..., whole], values[0][..., whole])))
    title = f"{axis.name} against {axis.labels[0]}, on the same drives (a seed counts with its geometric mean over all points)"
    return Table(title, ("error", axis.name, *COMPARED), rows, 2)


def _ranks(found: Swept, errors: list[str], axis: Axis) -> Table:
    rows = []
    for name in errors:
        one = ranks(found, name, axis)
        for i, who in enumerate(one.labels):
            known = np.isfinite(one.mean[i])
            rows.append(
                (name, who, *((float(one.mean[i]), f"{100 * one.shares[i, 0]:.1f} %") if known else ("-", "-")))
            )
    return Table(f"Ranks of {axis.name} on the same drives", ("error", axis.name, "mean rank", "best in"), rows, 2)


def _whole(there: np.ndarray) -> np.ndarray:
    """The seeds of which every point is computed: a seed counts with its geometric mean over all points."""
    return np.all(there.reshape(-1, there.shape[-1]), axis=0)


def _comparison(a: np.ndarray, b: np.ndarray) -> tuple[Any, ...]:
    """The cells of a comparison; where no run of either is finite, or fewer than two seeds are left, there is none."""
    if a.shape[-1] < 2 or not (np.isfinite(a) | np.isfinite(b)).any():
        return ("-",) * len(COMPARED)
    one = compare_by_seed(a, b)
    low, high = float(one.ratio.low), float(one.ratio.high)
    return float(one.ratio.value), f"{low:.3g} to {high:.3g}", f"{100 * float(one.wins):.1f} %"


def _listed(found: Swept) -> list[Axis]:
    """The axes whose labels are worth listing: all except samples."""
    return [axis for axis in found.design.axes if axis.columns is None]


def _heads(found: Swept, names: list[str]) -> list[str]:
    return [display_of(found, name).label for name in names]


def _label(value: Any, factor: float) -> str:
    return label(value * factor if isinstance(value, float) else value)


def _cell(values: np.ndarray) -> str:
    low, median, high = quartiles(values)
    if not np.isfinite(median):
        return "-"
    return f"{median:.3g}" if low == high else f"{median:.3g} ({low:.2g}–{high:.2g})"
