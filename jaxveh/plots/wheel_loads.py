"""Loads of the wheels over time, with wheel lift shaded."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import drive_channels
from jaxveh.plots.panels import WHEELS, has_wheels, line, note, stack, wheels
from jaxveh.plots.style import CYCLE, SHADE, label_above, legend, style

LIFTED = 0.01
"""Share of the mean load of all wheels and rows below which a wheel counts as lifted; our choice."""


def loads(recording: Recording, *, figure: Any = None) -> Any:
    """Draw the wheel loads (axle loads for a single track) and, below, the accelerations that transfer load.

    Spans in which any wheel lifts (below `LIFTED` of the mean load) are shaded.

    **Returns** the figure. **Raises** `InputError` if the recording has no loads.
    """
    axles = drive_channels.has(recording, "load_front", "load_rear")
    if not has_wheels(recording, "load") and not axles:
        raise InputError(
            "plots.loads: the recording has neither load_fl, load_fr, load_rl, load_rr nor load_front, load_rear."
        )
    time = drive_channels.seconds(recording)
    accelerations = [name for name in ("a_y", "a_x") if drive_channels.has(recording, name)]
    with style():
        figure, axes = stack(figure, 1 + len(accelerations), 1.5)
        if has_wheels(recording, "load"):
            wheels(axes[0], recording, "load", 1e-3, "wheel loads [kN]")
            _shade_lift(axes[0], recording, time)
        else:
            for index, axle in enumerate(("front", "rear")):
                load = drive_channels.channel(recording, f"load_{axle}") / 1e3
                axes[0].plot(time, load, color=CYCLE[index], label=f"{axle} axle")
            label_above(axes[0], "axle loads [kN]")
        axes[0].set_ylim(bottom=0)
        for ax, name in zip(axes[1:], accelerations, strict=True):
            line(ax, recording, name, color=CYCLE[2])
        legend(figure, axes)
    return figure


def wheel_lift(recording: Recording) -> np.ndarray:
    """Return whether any wheel is off the ground, (T,)."""
    each = np.stack([drive_channels.channel(recording, f"load_{wheel}") for wheel in WHEELS])
    return np.min(each, axis=0) < LIFTED * np.mean(each)


def _shade_lift(ax: Any, recording: Recording, time: np.ndarray) -> None:
    up = wheel_lift(recording)
    edges = np.flatnonzero(np.diff(np.r_[False, up, False].astype(int)))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        ax.axvspan(
            time[start], time[min(end, time.size - 1)], color=SHADE, linewidth=0, zorder=0, label="a wheel lifts"
        )
    each = {words: drive_channels.channel(recording, f"load_{wheel}") for wheel, words in WHEELS.items()}
    lightest = min(each, key=lambda words: float(np.min(each[words])))
    note(ax, f"least: {float(np.min(each[lightest])) / 1e3:.2f} kN, {lightest}")
