"""A recording's channels over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_names, check_names
from jaxveh._core.recording import TRUTH, Recording, check_recording
from jaxveh.plots.quantities import order, quantity
from jaxveh.plots.style import COLOURS, CYCLE, SHADE, label_above, legend, new_figure, style

MOST = 12
"""Largest number of panels on a page."""


def recording(
    recording: Recording,
    channels: Iterable[str] | None = None,
    *,
    spans: Sequence[tuple[float, float, str]] = (),
    figure: Any = None,
) -> Any:
    """Draw a panel per channel over the log's own time, with a simulation's truth as a black line behind the measurement.

    **Arguments**: `channels`: names to show (default: the first `MOST` that are not `true.`). `spans`: (start, end,
    label) in seconds to shade, such as a calibration or a finding. `figure`: the figure to draw into. NaN leaves a gap; samples
    between two gaps are dots.

    **Returns** the figure. **Raises** `InputError` for unknown channels, or if there is no channel.
    """
    check_recording("plots.recording", recording)
    names = list(as_names(channels)) if channels is not None else _default(recording)
    check_names("plots.recording", names, recording.names)
    if not names:
        raise InputError("plots.recording: no channel to show; name at least one.")
    time = np.asarray(recording.time)
    with style():
        figure = new_figure(0.6 + 1.05 * len(names)) if figure is None else figure
        axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for ax, name in zip(axes, names, strict=True):
            shown = quantity(name, recording.unit(name))
            for start, end, label in spans:
                ax.axvspan(start, end, color=SHADE, linewidth=0, zorder=0, label=label)
            _draw_measurement(ax, time, shown.show(recording[name]))
            if TRUTH + name in recording:
                ax.plot(time, shown.show(recording[TRUTH + name]), color=COLOURS["truth"], linewidth=0.9, label="truth")
            _mark_silence(ax, time, np.asarray(recording[name]))
            label_above(ax, shown.label)
        axes[-1].set_xlabel("time [s]")
        if len({label for ax in axes for label in ax.get_legend_handles_labels()[1]}) > 1:
            legend(figure, axes)
    return figure


def _default(recording: Recording) -> list[str]:
    return order(name for name in recording.names if not name.startswith(TRUTH))[:MOST]


def _draw_measurement(ax: Any, time: np.ndarray, values: np.ndarray) -> None:
    """Draw a line, and a dot for each sample between two gaps, which a line would not show (slow devices)."""
    known = np.isfinite(values)
    beside = np.r_[False, known[:-1]] | np.r_[known[1:], False]
    ax.plot(time, values, color=CYCLE[0], linewidth=0.9, label="measured")
    alone = known & ~beside
    if alone.any():
        ax.plot(time[alone], values[alone], ".", color=CYCLE[0], markersize=3.5)


def _mark_silence(ax: Any, time: np.ndarray, values: np.ndarray) -> None:
    """Write a note into the panel of a channel without samples, which would be empty."""
    if not np.isfinite(values).any():
        ax.set_xlim(time[0], time[-1])
        ax.set_yticks([])
        ax.text(0.5, 0.5, "no finite sample", transform=ax.transAxes, ha="center", va="center", color="#888888")
