"""Panels over time that the figures of drives share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.diagnostics import drive_channels
from jaxveh.plots.quantities import Quantity, quantity
from jaxveh.plots.style import CYCLE, label_above, legend, new_figure, style

WHEELS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}

WHEEL_STYLE = {
    "fl": {"color": CYCLE[0], "linestyle": "-"},
    "fr": {"color": CYCLE[0], "linestyle": (0, (4, 2))},
    "rl": {"color": CYCLE[1], "linestyle": "-"},
    "rr": {"color": CYCLE[1], "linestyle": (0, (4, 2))},
}
"""One colour per axle, and dashes for the right wheels."""

GREY = "#666666"


def display_of(name: str) -> Quantity:
    """Return label and unit of a quantity of a drive, with the package's units."""
    return quantity(name)


def values(recording: Recording, name: str) -> np.ndarray:
    """Return a channel in the unit of its axis."""
    taken = drive_channels.sideslip(recording) if name == "sideslip" else drive_channels.channel(recording, name)
    return display_of(name).show(taken)


def stack(figure: Any, count: int, each: float = 1.35) -> tuple[Any, np.ndarray]:
    """Return a figure (the given one, if any) with `count` panels over the same time, the last with the time's label."""
    figure = new_figure(0.75 + each * count) if figure is None else figure
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def line(ax: Any, recording: Recording, name: str, **style: Any) -> None:
    """Draw one channel over time, with its label above."""
    ax.plot(
        drive_channels.seconds(recording), values(recording, name), **{"color": CYCLE[0], "linewidth": 1.2, **style}
    )
    label_above(ax, display_of(name).label)


def wheels(ax: Any, recording: Recording, prefix: str, factor: Any, label: str) -> None:
    """Draw a channel of each wheel over time, times a factor (a number, or one by wheel)."""
    time = drive_channels.seconds(recording)
    for wheel, words in WHEELS.items():
        scale = factor[wheel] if isinstance(factor, dict) else factor
        of_wheel = scale * drive_channels.channel(recording, f"{prefix}_{wheel}")
        ax.plot(time, of_wheel, linewidth=1.1, label=words, **WHEEL_STYLE[wheel])
    label_above(ax, label)


def has_wheels(recording: Recording, prefix: str) -> bool:
    """Whether the recording has this channel of all four wheels."""
    return drive_channels.has(recording, *[f"{prefix}_{wheel}" for wheel in WHEELS])


def note(ax: Any, text: str) -> None:
    """Write the numbers of a panel above it on the right, where there is no line."""
    ax.set_title(text.replace("-", "\N{MINUS SIGN}"), loc="right", fontweight="normal", fontsize=8, color=GREY, pad=3.0)


def round_number(value: float) -> float:
    """Return the number 1, 2 or 5 times a power of ten at or below `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)) * power


OVERVIEW = ("steer", "v_x", "yaw_rate", "a_y", "sideslip")


def overview(recording: Recording, *, figure: Any = None) -> Any:
    """Draw the motion of a car: steer, speed, yaw rate, lateral acceleration, sideslip, as far as the recording has them."""
    with style():
        names = [name for name in OVERVIEW if _there(recording, name)]
        figure, axes = stack(figure, len(names), 1.1)
        for ax, name in zip(axes, names, strict=True):
            line(ax, recording, name)
        legend(figure, axes)
    return figure


def _there(recording: Recording, name: str) -> bool:
    return drive_channels.has(recording, name) or (name == "sideslip" and drive_channels.has(recording, "v_x", "v_y"))
