"""Estimates over time: mean, the band that should hold the truth in 95 % of the rows, and the truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_mapping, check_names
from jaxveh._core.recording import Recording
from jaxveh.plots.quantities import quantity
from jaxveh.plots.style import COLOURS, colour, label_above, legend, new_figure, style

BAND = 1.959963984540054
"""Standard deviations of a normal law's central 95 %."""


def estimate(
    estimates: Any,
    truth: Recording | Mapping[str, Any] | None = None,
    quantities: Iterable[str] | None = None,
    *,
    others: Mapping[str, Mapping[str, Any]] | None = None,
    errors: bool = False,
    figure: Any = None,
) -> Any:
    """A panel a quantity: mean, 95 % band and, where given, the truth.

    **Arguments**: `estimates`: an `Estimate` of `jaxveh.run` (or anything with `time`, `mean` and `std` by name), or a
    mapping from labels to several. `truth`: a recording, or a mapping from names to (T,) arrays over the time of
    the first estimate. `quantities`: names to show (default: all that the first reports). `others`: label to a mapping
    from names to (T,) without spread, such as an open-loop model's, over the time of the first. `errors`: beside each
    panel another with the estimates less the truth (over the same rows), and their bands. `figure`: where to draw.

    **Returns** the figure. **Raises** `InputError` for unknown quantities or a truth of another length.
    """
    labelled = dict(estimates) if isinstance(estimates, Mapping) else {"estimate": estimates}
    if not labelled:
        raise InputError("plots.estimate: no estimate to show; give at least one.")
    first = next(iter(labelled.values()))
    known = as_mapping(first.mean, "mean")
    names = list(known if quantities is None else quantities)
    check_names("plots.estimate", names, known)
    time = np.asarray(first.time)
    if errors and truth is None:
        raise InputError("plots.estimate: errors need a truth; give `truth=`, or leave `errors` out.")
    with style():
        figure = new_figure(0.75 + 1.25 * len(names)) if figure is None else figure
        ratios = [3, 2] if errors else [1]
        axes = figure.subplots(len(names), len(ratios), sharex=True, squeeze=False, width_ratios=ratios)
        for row, name in zip(axes, names, strict=True):
            shown = quantity(name)
            _truth(row[0], time, truth, name)
            for index, (label, values) in enumerate((others or {}).items()):
                if name in values:
                    _line(row[0], time, shown.show(values[name]), label, colour(label.partition(",")[0], index + 2))
            for index, (label, one) in enumerate(labelled.items()):
                _one(row[0], one, name, label, colour(label, index))
                if errors and truth is not None and name in truth:
                    _one(row[1], one, name, label, colour(label, index), shown.show(truth[name]))
            _keep_truth_readable(row[0])
            label_above(row[0], shown.label)
            if errors and (truth is None or name not in truth):
                row[1].set_visible(False)
            elif errors:
                row[1].axhline(0, color=COLOURS["truth"], linewidth=0.9, zorder=1.5)
                label_above(row[1], f"error [{shown.unit}]" if shown.unit else "error")
        for ax in axes[-1]:
            ax.set_xlabel("time [s]")
        legend(figure, axes)
    return figure


def _truth(ax: Any, time: np.ndarray, truth: Any, name: str) -> None:
    if truth is None or name not in truth:
        return
    at = np.asarray(truth.time) if isinstance(truth, Recording) else time
    values = quantity(name).show(truth[name])
    if values.shape != at.shape:
        raise InputError(f"plots.estimate: truth {name} has shape {values.shape}, time has {at.shape}; must agree.")
    # Thicker than the estimates, which lie on it when they are good.
    ax.plot(at, values, color=COLOURS["truth"], linewidth=1.7, label="truth")


def _keep_truth_readable(ax: Any) -> None:
    """Where an estimate diverges it leaves the panel: the truth sets the scale, with room around it."""
    true = [line.get_ydata() for line in ax.get_lines() if line.get_label() == "truth"]
    if not true or not np.isfinite(true[0]).any():
        return
    low, high = float(np.nanmin(true[0])), float(np.nanmax(true[0]))
    bottom, top = ax.get_ylim()
    room = (high - low) / 2
    if room > 0:
        ax.set_ylim(max(bottom, low - room), min(top, high + room))


def _one(ax: Any, one: Any, name: str, label: str, shade: str, against: Any = 0.0) -> None:
    """Mean and band of one estimate, less the values that it is held against."""
    mean, std = as_mapping(one.mean, "mean"), as_mapping(one.std, "std")
    if name not in mean:
        return
    time, shown = np.asarray(one.time), quantity(name)
    if np.shape(against) not in ((), time.shape):
        raise InputError(
            f"plots.estimate: truth {name} has shape {np.shape(against)}, {label} {time.shape}; must agree."
        )
    centre = shown.show(mean[name]) - against
    if name in std:
        reach = BAND * shown.show(std[name])
        ax.fill_between(time, centre - reach, centre + reach, color=shade, alpha=0.2, lw=0, label=f"{label}, 95 % band")
    _line(ax, time, centre, label, shade)


def _line(ax: Any, time: np.ndarray, values: np.ndarray, label: str, shade: str) -> None:
    ax.plot(time, values, color=shade, linewidth=1.1, label=label)
