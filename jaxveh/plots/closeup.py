"""The part of a log in which its estimate is worst, with the motion of the car."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.names import as_mapping, as_names, check_names
from jaxveh._core.recording import Recording, check_recording
from jaxveh.plots.estimates import BAND, bands, check_estimate, check_truth
from jaxveh.plots.quantities import quantity
from jaxveh.plots.style import COLOURS, CYCLE, label_above, legend, new_figure, style

CHANNELS = ("v_x", "yaw_rate", "a_y", "steer")
"""The channels below the estimate, as far as the log has them."""


def closeup(
    estimate: Any,
    recording: Recording,
    truth: Mapping[str, Any] | None = None,
    quantity_name: str = "sideslip",
    *,
    others: Mapping[str, Mapping[str, Any]] | None = None,
    channels: Iterable[str] | None = None,
    seconds: float = 20.0,
    least_speed: float = 0.0,
    figure: Any = None,
) -> Any:
    """Draw the worst `seconds` of an estimate with the log's channels below.

    They are the seconds about the largest error against the truth or, without a truth, about the widest band.

    **Arguments**: `estimate`: of `jaxveh.run` or a smoother, with `time` (T,), `mean` and `std` by name. `recording`: the log
    with the same rows. `truth`, `others`: names to (T,), and labels to such mappings, as in `plots.estimate`. `quantity_name`:
    the quantity to show. `channels`: of the log (default: those of `CHANNELS` that it has). `least_speed` (m/s): slower rows do
    not count, if the log has `v_x`. `figure`: the figure to draw into.

    **Returns** the figure. **Raises** `InputError` for unknown names, rows that do not agree, or if there is no finite value.
    """
    check_estimate("plots.closeup", estimate, "mean", "std")
    check_recording("plots.closeup", recording)
    check_truth("plots.closeup", truth)
    mean = as_mapping(estimate.mean, "mean")
    check_names("plots.closeup", [quantity_name], mean)
    shown_channels = [name for name in CHANNELS if name in recording] if channels is None else list(as_names(channels))
    check_names("plots.closeup", shown_channels, recording.names)
    start, end, why = worst_span(estimate, recording, truth, quantity_name, seconds=seconds, least_speed=least_speed)
    time = np.asarray(estimate.time)
    rows = (time >= start) & (time <= end)
    with style():
        heights = [2.6, *[1.1] * len(shown_channels)]
        figure = new_figure(0.6 + sum(heights)) if figure is None else figure
        axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
        _estimate(axes[0], estimate, rows, quantity_name, truth or {}, others or {})
        axes[0].set_title(why, loc="right", fontweight="normal", fontsize=8, color="#666666", pad=3.0)
        for ax, name in zip(axes[1:], shown_channels, strict=True):
            in_unit = quantity(name, recording.unit(name))
            ax.plot(time[rows], in_unit.show(recording[name])[rows], color="#444444", linewidth=0.9)
            label_above(ax, in_unit.label)
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(start, end)
        legend(figure, axes)
    return figure


def worst_span(
    estimate: Any, recording: Recording, truth: Mapping[str, Any] | None, name: str, *, seconds: float, least_speed: float
) -> tuple[float, float, str]:  # fmt: skip
    """Return start and end (s) of the worst part of an estimate, inside the log, and a description of the worst row."""
    check_positive("seconds", seconds, "s")
    time, shown = np.asarray(estimate.time, np.float64), quantity(name)
    if time.shape != np.shape(recording.time):
        raise InputError(f"plots.closeup: {time.size} rows estimated, {len(recording)} in the recording; must agree.")
    centre = shown.show(as_mapping(estimate.mean, "mean")[name])
    if truth is not None and name in truth:
        badness, what = np.abs(centre - shown.show(truth[name])), "largest error"
    else:
        badness, what = BAND * shown.show(as_mapping(estimate.std, "std")[name]), "widest 95 % band, ±"
    counted = np.isfinite(badness)
    if "v_x" in recording:
        counted &= ~(np.asarray(recording["v_x"]) < least_speed)
    if not counted.any():
        raise InputError(f"plots.closeup: no row at {least_speed:g} m/s or more has a finite {name}.")
    worst = int(np.argmax(np.where(counted, badness, -np.inf)))
    first = min(max(time[worst] - seconds / 2, time[0]), max(time[-1] - seconds, time[0]))
    space = "" if what.endswith("±") else " "
    why = f"{what}{space}{badness[worst]:.2g}{shown.unit and ' ' + shown.unit} at {time[worst]:.5g} s"
    return float(first), float(min(first + seconds, time[-1])), why


def _estimate(ax: Any, estimate: Any, rows: np.ndarray, name: str, truth: Mapping, others: Mapping) -> None:
    """Draw bands, estimate, others and truth over these rows alone, so that they set the scale."""
    shown, time = quantity(name), np.asarray(estimate.time)[rows]
    centre, std = (shown.show(as_mapping(part, "estimate")[name])[rows] for part in (estimate.mean, estimate.std))
    if name in truth:
        ax.plot(time, shown.show(truth[name])[rows], color=COLOURS["truth"], linewidth=1.4, label="truth")
    for index, (label, values) in enumerate(others.items()):
        if name in values:
            ax.plot(time, shown.show(values[name])[rows], color=CYCLE[index + 2], linewidth=1.1, label=label)
    bands(ax, time, centre, std, "estimate", CYCLE[0])
    ax.plot(time, centre, color=CYCLE[0], linewidth=1.1, label="estimate")
    label_above(ax, shown.label)
