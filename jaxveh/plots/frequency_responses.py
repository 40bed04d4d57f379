"""Gain, phase and coherence over frequency, from a drive with a swept sine or random steering (ISO 7401)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from jaxveh._core.names import check_names
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import frequency_response as measure
from jaxveh.plots.panels import display_of
from jaxveh.plots.style import COLOURS, CYCLE, label_above, legend, new_figure, style

POINTS = 200


def frequency_response(
    recording: Recording,
    output: str | Iterable[str] = ("yaw_rate", "a_y"),
    *,
    segment: float | None = None,
    closed_form: Mapping[str, Callable[[np.ndarray], Any]] | None = None,
    figure: Any = None,
) -> Any:
    """Draw gain of output over steer, phase and coherence over frequency in Hz, a column per output.

    They are estimated by `jaxveh.diagnostics.frequency_response`, which explains `segment` (s). `closed_form`: output to a
    function from frequencies (n,) in Hz to the complex response (n,) in SI units, such as that of a linear single track, which is
    also drawn.

    **Returns** the figure. **Raises** `InputError` if the recording has no such steering, or an output is missing.
    """
    outputs = [output] if isinstance(output, str) else list(output)
    closed_form = closed_form or {}
    check_names("plots.frequency_response: closed_form", closed_form, outputs)
    with style():
        figure = new_figure(4.6) if figure is None else figure
        axes = figure.subplots(3, len(outputs), sharex=True, squeeze=False, height_ratios=[3, 3, 1.4])
        for column, name in zip(axes.T, outputs, strict=True):
            found = measure(recording, name, segment=segment)
            _response(column, name, found.frequency, found.response, color=CYCLE[0], linewidth=1.4, label="drive")
            if name in closed_form:
                fine = np.geomspace(found.frequency[0], found.frequency[-1], POINTS)
                exact = np.asarray(closed_form[name](fine))
                _response(
                    column,
                    name,
                    fine,
                    exact,
                    color=COLOURS["truth"],
                    linewidth=1.0,
                    linestyle="--",
                    label="closed form",
                )
            column[2].plot(found.frequency, found.coherence, color=CYCLE[0])
            column[2].set_ylim(0, 1.05)
            _label(column, name, found.frequency)
        if closed_form:
            legend(figure, axes)
    return figure


def _response(column: Any, name: str, frequency: np.ndarray, response: np.ndarray, **line: Any) -> None:
    # Steer is in degrees, so that the gain of an angle keeps its value.
    per_degree = display_of(name).factor * np.pi / 180
    column[0].plot(frequency, np.abs(response) * per_degree, **line)
    column[1].plot(frequency, np.degrees(np.unwrap(np.angle(response))), **line)


def _label(column: Any, name: str, frequency: np.ndarray) -> None:
    unit = display_of(name)
    words = unit.label.partition(" [")[0]
    shown_unit = {"°/s": "1/s", "°": "-"}.get(unit.unit, f"{unit.unit} per °")
    label_above(column[0], f"{words} over steer [{shown_unit}]")
    label_above(column[1], "phase [°]")
    label_above(column[2], "coherence [-]")
    column[0].set_ylim(bottom=0)
    column[2].set_xlabel("frequency [Hz]")
    column[2].set_xscale("log")
    ticks = [
        tick
        for tick in (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20)
        if 0.99 * frequency[0] <= tick <= 1.01 * frequency[-1]
    ]
    column[2].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    column[2].set_xticks([], minor=True)
