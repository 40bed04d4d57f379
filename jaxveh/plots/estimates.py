"""Estimates over time: mean, the bands that should contain the truth in 50 and 95 % of the rows, and the truth."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_kind, check_positive, word_for
from jaxveh._core.names import as_mapping, as_names, check_names
from jaxveh._core.recording import Recording
from jaxveh.plots.quantities import quantity
from jaxveh.plots.style import COLOURS, colour, label_above, legend, new_figure, style

BAND, HALF_BAND = 1.959963984540054, 0.6744897501960817
"""Half the widths of the central 95 and 50 % intervals of a normal distribution, in standard deviations."""

MOST_ROWS = 12
"""Largest number of rows for a long log; a longer log has longer rows."""


class Shown(NamedTuple):
    """The data of a figure's panels."""

    labelled: dict[str, Any]
    time: np.ndarray
    truth: Any
    others: Mapping[str, Mapping[str, Any]]
    fine: float
    """The factor of the line widths."""

    def has_truth(self, name: str) -> bool:
        """Whether there is a truth of a quantity."""
        return self.truth is not None and name in self.truth


def check_estimate(who: str, estimate: Any, *fields: str) -> None:
    """Raise `InputError` unless it has `time` (T,) and the `fields`: several runs, as `jax.vmap` returns them, have no such
    time."""
    if not all(hasattr(estimate, name) for name in ("time", *fields)):
        raise InputError(
            f"{who}: estimate = {word_for(estimate)}: must have time, {' and '.join(fields)}, as an Estimate of jaxveh.run."
        )
    if np.ndim(estimate.time) != 1:
        raise InputError(
            f"{who}: estimate.time has shape {np.shape(estimate.time)}: must be (T,), one run. Take one of several, "
            "jax.tree.map(lambda leaf: leaf[0], estimates)."
        )


def check_truth(who: str, truth: Any) -> None:
    """Raise `InputError` unless it is a recording or a mapping, or None."""
    if truth is not None:
        check_kind(f"{who}: truth", truth, Recording | Mapping, "Such as {'sideslip': values}.")


def estimate(
    estimates: Any,
    truth: Recording | Mapping[str, Any] | None = None,
    quantities: Iterable[str] | None = None,
    *,
    others: Mapping[str, Mapping[str, Any]] | None = None,
    errors: bool = False,
    seconds: float = 60.0,
    figure: Any = None,
) -> Any:
    """Draw a panel per quantity with mean, bands of 50 and 95 % and, if given, the truth; a long log is split into rows.

    **Arguments**: `estimates`: an `Estimate` of `jaxveh.run` (or anything with `time`, `mean` and `std` by name), or a
    mapping from labels to several, which are drawn with only their 95 % bands. `truth`: a recording, or a mapping from names to
    (T,) arrays over the time of the first estimate. `quantities`: names to show (default: all of the first estimate). `others`:
    label to a mapping from names to (T,) without standard deviations, such as those of an open-loop model, over the time of the
    first. `errors`: adds beside each panel (below each row of a long log) another with the estimates less the truth (over the
    same rows), and their bands. `seconds`: approximate length of a row; a log longer than one and a half rows is split into at
    most `MOST_ROWS` rows per quantity. `figure`: the figure to draw into.

    **Returns** the figure. **Raises** `InputError` for unknown quantities, a truth of another length, or `seconds` that are not
    positive.
    """
    check_flags(errors=errors)
    labelled = dict(estimates) if isinstance(estimates, Mapping) else {"estimate": estimates}
    if not labelled:
        raise InputError("plots.estimate: no estimate to show; give at least one.")
    for one in labelled.values():
        check_estimate("plots.estimate", one, "mean", "std")
    first = next(iter(labelled.values()))
    known = as_mapping(first.mean, "mean")
    names = list(known if quantities is None else as_names(quantities))
    check_names("plots.estimate", names, known)
    check_truth("plots.estimate", truth)
    if errors and truth is None:
        raise InputError("plots.estimate: errors need a truth; give `truth=`, or leave `errors` out.")
    check_positive("seconds", seconds, "s")
    time = np.asarray(first.time)
    spans = rows_of(time, seconds)
    # Rows show more time, and bands beside thick lines would not be visible.
    shown = Shown(labelled, time, truth, others or {}, 1.0 if len(spans) == 1 else 0.65)
    with style():
        draw = _beside if len(spans) == 1 else _in_rows
        figure, axes = draw(shown, names, spans, errors, figure)
        legend(figure, axes)
    return figure


def rows_of(time: np.ndarray, seconds: float) -> list[tuple[float, float]]:
    """Split a log with time stamps (T,) into spans of equal length (s), about `seconds` each."""
    start, end = float(time[0]), float(time[-1])
    count = min(max(1, round((end - start) / seconds)), MOST_ROWS)
    edges = np.linspace(start, end, count + 1)
    return [(float(a), float(b)) for a, b in itertools.pairwise(edges)]


def _beside(shown: Shown, names: list[str], spans: Any, errors: bool, figure: Any) -> tuple[Any, Any]:
    """Draw a panel per quantity, with its errors on the right."""
    del spans
    figure = new_figure(0.75 + 1.25 * len(names)) if figure is None else figure
    ratios = [3, 2] if errors else [1]
    axes = figure.subplots(len(names), len(ratios), sharex=True, squeeze=False, width_ratios=ratios)
    for row, name in zip(axes, names, strict=True):
        _values(row[0], shown, name)
        if errors and not shown.has_truth(name):
            row[1].set_visible(False)
        elif errors:
            _errors(row[1], shown, name)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    return figure, axes


def _in_rows(shown: Shown, names: list[str], spans: list, errors: bool, figure: Any) -> tuple[Any, Any]:
    """Draw the rows of a quantity above each other, each with its errors below, all to one scale.

    Each panel contains the data of all rows, and shows its own part of the time.
    """
    kinds = [
        (name, span, draw)
        for name in names
        for span in spans
        for draw in ((_values, _errors) if errors and shown.has_truth(name) else (_values,))
    ]
    heights = [2.1 if draw is _values else 1.2 for _, _, draw in kinds]
    figure = new_figure(0.6 + sum(heights)) if figure is None else figure
    axes = figure.subplots(len(kinds), 1, squeeze=False, height_ratios=heights)[:, 0]
    for ax, (name, span, draw) in zip(axes, kinds, strict=True):
        draw(ax, shown, name)
        ax.set_xlim(*span)
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g} s")
    return figure, axes


def _values(ax: Any, shown: Shown, name: str) -> None:
    """Draw the estimates of a quantity, and the truth."""
    in_unit = quantity(name)
    _truth(ax, shown, name)
    for index, (label, values) in enumerate(shown.others.items()):
        if name in values:
            shade = colour(label.partition(",")[0], index + 2)
            ax.plot(shown.time, in_unit.show(values[name]), color=shade, linewidth=1.1 * shown.fine, label=label)
    for index, (label, one) in enumerate(shown.labelled.items()):
        _one(ax, shown, one, name, label, colour(label, index))
    _keep_truth_readable(ax)
    label_above(ax, in_unit.label)


def _errors(ax: Any, shown: Shown, name: str) -> None:
    """Draw the estimates less the truth."""
    in_unit = quantity(name)
    for index, (label, one) in enumerate(shown.labelled.items()):
        against = in_unit.show(shown.truth[name])
        _one(ax, shown, one, name, label, colour(label, index), against)
    ax.axhline(0, color=COLOURS["truth"], linewidth=0.9, zorder=1.5)
    label_above(ax, f"error [{in_unit.unit}]" if in_unit.unit else "error")


def _truth(ax: Any, shown: Shown, name: str) -> None:
    if not shown.has_truth(name):
        return
    at = np.asarray(shown.truth.time) if isinstance(shown.truth, Recording) else shown.time
    values = quantity(name).show(shown.truth[name])
    if values.shape != at.shape:
        raise InputError(f"plots.estimate: truth {name} has shape {values.shape}, time has {at.shape}; must agree.")
    # Thicker than the estimates, because good estimates cover it.
    ax.plot(at, values, color=COLOURS["truth"], linewidth=1.7 * shown.fine, label="truth")


def _keep_truth_readable(ax: Any) -> None:
    """Set the scale by the truth, with room around it: an estimate that diverges leaves the panel."""
    true = [line.get_ydata() for line in ax.get_lines() if line.get_label() == "truth"]
    if not true or not np.isfinite(true[0]).any():
        return
    low, high = float(np.nanmin(true[0])), float(np.nanmax(true[0]))
    bottom, top = ax.get_ylim()
    room = (high - low) / 2
    if room > 0:
        ax.set_ylim(max(bottom, low - room), min(top, high + room))


def _one(ax: Any, shown: Shown, one: Any, name: str, label: str, shade: str, against: Any = 0.0) -> None:
    """Draw mean and bands of one estimate, less the values `against` which it is compared."""
    mean, std = as_mapping(one.mean, "mean"), as_mapping(one.std, "std")
    if name not in mean:
        return
    time, in_unit = np.asarray(one.time), quantity(name)
    if np.shape(against) not in ((), time.shape):
        raise InputError(
            f"plots.estimate: truth {name} has shape {np.shape(against)}, {label} {time.shape}; must agree."
        )
    centre = in_unit.show(mean[name]) - against
    # Methods without standard deviations have NaN, and no band.
    if name in std and not np.isnan(np.asarray(std[name])).all():
        bands(ax, time, centre, in_unit.show(std[name]), label, shade, half=len(shown.labelled) == 1)
    ax.plot(time, centre, color=shade, linewidth=1.1 * shown.fine, label=label)


def bands(
    ax: Any, time: np.ndarray, centre: np.ndarray, std: np.ndarray, label: str, shade: str, *, half: bool = True
) -> None:
    """Draw the central 95 % band, and with `half` the 50 % band, of normal distributions about `centre` (T,) with `std` (T,)."""
    for share, width, alpha in ((95, BAND, 0.22), (50, HALF_BAND, 0.4))[: 1 + half]:
        low, high = centre - width * std, centre + width * std
        ax.fill_between(time, low, high, color=shade, alpha=alpha, lw=0, label=f"{label}, {share} % band")
