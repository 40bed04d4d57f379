"""A car's response to a step of the steering, with the numbers of ISO 7401."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from jaxveh._core.names import as_names
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import StepResponse, drive_channels, kit
from jaxveh.diagnostics import step_response as measure
from jaxveh.plots.panels import GREY, display_of, line, note, stack, values
from jaxveh.plots.style import CYCLE, legend, style


def step_response(
    recording: Recording,
    outputs: Iterable[str] = ("yaw_rate", "a_y", "sideslip"),
    *,
    average: float = 0.5,
    figure: Any = None,
) -> Any:
    """Draw steer and `outputs` over time; steady value, 90 % and peak are marked, with their numbers above each panel.

    The numbers are those of `jaxveh.diagnostics.step_response`, which explains `average` (s).

    **Returns** the figure. **Raises** `InputError` if the recording has no such step, or an output is missing.
    """
    outputs = list(as_names(outputs))
    with style():
        figure, axes = stack(figure, 1 + len(outputs), 1.4)
        line(axes[0], recording, "steer")
        for ax, name in zip(axes[1:], outputs, strict=True):
            found = _measure_response(recording, name, average)
            line(ax, recording, name)
            _mark(ax, recording, name, found)
            axes[0].axvline(found.reference, color=GREY, linewidth=0.7, linestyle=":")
        note(axes[0], "times count from half of the step")
        legend(figure, axes)
    return figure


def _measure_response(recording: Recording, name: str, average: float) -> StepResponse:
    if name == "sideslip":
        recording = recording.replace(sideslip=drive_channels.sideslip(recording))
    return measure(recording, name, average=average)


def _mark(ax: Any, recording: Recording, name: str, found: StepResponse) -> None:
    unit = display_of(name)
    before = float(values(recording, name)[0])
    place = lambda share: before + unit.factor * found.steady * share
    ax.axvline(found.reference, color=GREY, linewidth=0.7, linestyle=":")
    ax.axhline(place(1.0), color=GREY, linewidth=0.8, linestyle="--", label="steady value")
    words = [f"steady {place(1.0) - before:.3g} {unit.unit}"]
    if np.isfinite(found.response_time):
        at = found.reference + found.response_time
        ax.plot([at], [place(kit.RESPONSE_SHARE)], "o", color=CYCLE[1], markersize=4.5, label="90 % of it")
        words.append(f"90 % after {found.response_time:.3f} s")
    if np.isfinite(found.peak):
        at = found.reference + found.peak_response_time
        ax.plot([at], [before + unit.factor * found.peak], "s", color=CYCLE[2], markersize=4.5, label="peak")
        words.append(f"peak after {found.peak_response_time:.3f} s, {100 * found.overshoot:.1f} % over")
    note(ax, ",  ".join(words))
