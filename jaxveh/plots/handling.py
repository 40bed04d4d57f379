"""The handling diagram: steer and sideslip over lateral acceleration in steady turns (ISO 4138)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import SteadyTurns, kit, steady_turns, understeer
from jaxveh.plots.panels import GREY
from jaxveh.plots.style import colour, label_above, legend, new_figure, style


def handling_diagram(
    recordings: Recording | Mapping[str, Recording],
    wheelbase: float | Mapping[str, float] | None = None,
    *,
    linear: float = kit.LINEAR_A_Y,
    figure: Any = None,
) -> Any:
    """Draw steer and sideslip over lateral acceleration of one drive, or of several by label.

    The drives must be quasi-steady, such as a slow ramp of steer, or a circle at slowly rising speed. With the `wheelbase` (m, or
    one by label) the geometric steer, wheelbase times curvature, is subtracted from the steer, and the understeer gradient in the
    linear range (|a_y| up to `linear`, m/s^2) is drawn and written in degrees per m/s^2 at the road wheels.

    **Returns** the figure. **Raises** `InputError` for missing channels, no recording, or a range of a_y that is too small.
    """
    labelled = dict(recordings) if isinstance(recordings, Mapping) else {"drive": recordings}
    if not labelled:
        raise InputError("plots.handling_diagram: no recording to show; give at least one.")
    with style():
        figure = new_figure(3.4) if figure is None else figure
        axes = figure.subplots(1, 2, sharex=True)
        words = []
        for index, (label, one) in enumerate(labelled.items()):
            length = wheelbase.get(label) if isinstance(wheelbase, Mapping) else wheelbase
            turns = steady_turns(one, length)
            words.append(_one(axes, turns, label, colour(label, index), linear))
        with_geometry = wheelbase is not None
        label_above(axes[0], "steer less wheelbase / radius [°]" if with_geometry else "steer [°]")
        label_above(axes[1], "sideslip [°]")
        for ax in axes:
            ax.set_xlabel("lateral acceleration [m/s²]")
        if any(words):
            axes[0].text(0.03, 0.97, "\n".join(filter(None, words)), transform=axes[0].transAxes, va="top", fontsize=8,
                         color=GREY)  # fmt: skip
            _make_room(axes[0])
        legend(figure, axes)
    return figure


def _one(axes: Any, turns: SteadyTurns, label: str, shade: str, linear: float) -> str:
    """Draw the lines of one drive, and return its gradient in words."""
    steer = turns.steer if turns.geometric_steer is None else turns.steer - turns.geometric_steer
    axes[0].plot(turns.a_y, np.degrees(steer), color=shade, linewidth=1.4, label=label)
    axes[1].plot(turns.a_y, np.degrees(turns.sideslip), color=shade, linewidth=1.4, label=label)
    if turns.geometric_steer is None:
        return ""
    found = understeer(turns, linear=linear)
    used = np.abs(turns.a_y) <= linear
    end = np.array([np.min(turns.a_y[used]), np.max(turns.a_y[used])])
    for ax, values, slope in zip(axes, (steer, turns.sideslip), found[:2], strict=True):
        middle = np.mean(values[used] - slope * turns.a_y[used])
        line = np.degrees(slope * end + middle)
        ax.plot(end, line, color="#000000", linewidth=0.9, linestyle="--", zorder=3, label=f"linear to {linear:g} m/s²")
    return f"{label}: understeer gradient {np.degrees(found.gradient):.3g} ° per m/s²"


def _make_room(ax: Any) -> None:
    """Make room for the text in the upper left corner."""
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.15 * (high - low))
