"""A car from above with its dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, word_for
from jaxveh.io import CarSpecification
from jaxveh.plots.car_outline import BESIDE, OVERHANG, WHEEL
from jaxveh.plots.style import COLOURS, CYCLE, new_figure, style
from jaxveh.vehicles import AbstractVehicle

WIDTH = 0.2
"""Width of a drawn wheel, m."""

LEAST_TRACK = 0.3
"""Wheels of an axle that are closer to each other count as on one track, m."""


def car(vehicle: AbstractVehicle | CarSpecification, *, figure: Any = None) -> Any:
    """Draw the car from above: its wheels, with wheelbase and tracks in m, and the reference point of its speeds.

    The reference point is the centre of gravity, unless the vehicle has another one. The body around the wheels is our choice.

    **Returns** the figure; `figure`: the figure to draw into. **Raises** `InputError` for a car without wheels, or a batch of
    cars.
    """
    if not isinstance(vehicle, AbstractVehicle | CarSpecification):
        raise InputError(f"plots.car: vehicle = {word_for(vehicle)}: must be a vehicle, or a car's file (io.read_car).")
    places = _places(vehicle)
    if any(np.ndim(number) for place in places for number in place):
        raise InputError("plots.car: a batch of cars: must be one, such as jax.tree.map(lambda leaf: leaf[0], cars).")
    wheels = np.array([[float(number) for number in place] for place in places])
    front, rear = wheels[:2, 0].mean(), wheels[2:, 0].mean()
    if front - rear <= 0:
        raise InputError(f"plots.car: {type(vehicle).__name__} has no wheel positions: there is nothing to draw.")
    tracks = [float(np.ptp(pair[:, 1])) for pair in (wheels[:2], wheels[2:])]
    half = max(*tracks, 1.0) / 2 + BESIDE
    with style():
        figure = new_figure(3.6) if figure is None else figure
        ax = figure.subplots()
        nose, tail = front + OVERHANG[0], rear - OVERHANG[1]
        outline = [
            (tail, -half),
            (nose - 0.5, -half),
            (nose, 0.4 - half),
            (nose, half - 0.4),
            (nose - 0.5, half),
            (tail, half),
        ]
        ax.fill(*zip(*outline, strict=True), facecolor=COLOURS["truth"], alpha=0.07)
        for x, y in {(round(float(x), 6), round(float(y), 6)) for x, y in wheels}:
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [WHEEL / 2, WIDTH / 2] + [x, y]
            ax.fill(*corners.T, facecolor=CYCLE[0], alpha=0.8)
        ax.plot(0.0, 0.0, marker="o", color=COLOURS["truth"], ms=5)
        _measure(ax, (rear, 0.0), (0.0, 0.0), -half - 0.25, f"{-rear:.3f}")
        _measure(ax, (0.0, 0.0), (front, 0.0), -half - 0.25, f"{front:.3f}")
        _measure(ax, (rear, 0.0), (front, 0.0), -half - 0.6, f"{front - rear:.3f} m")
        for x, track in zip((front, rear), tracks, strict=True):
            if track > LEAST_TRACK:
                ax.annotate(f"{track:.3f}", (x, 0.0), ha="center", va="center", fontsize=8, rotation=90)
        ax.set_title(type(vehicle).__name__, fontweight="normal")
        ax.set_aspect("equal")
        ax.axis("off")
        ax.set(xlim=(tail - 0.1, nose + 0.1), ylim=(-half - 0.85, half + 0.1))
    return figure


def _places(vehicle: AbstractVehicle | CarSpecification) -> tuple[tuple[Any, Any], ...]:
    """Return the positions of the wheels like `AbstractVehicle.wheel_positions`; a file without tracks has a single track."""
    if isinstance(vehicle, AbstractVehicle):
        return vehicle.wheel_positions
    front, rear = (vehicle.track_front or 0.0) / 2, (vehicle.track_rear or 0.0) / 2
    to_front, to_rear = vehicle.front_axle_to_cg, -vehicle.rear_axle_to_cg
    return ((to_front, front), (to_front, -front), (to_rear, rear), (to_rear, -rear))


def _measure(ax: Any, start: tuple[float, float], end: tuple[float, float], y: float, words: str) -> None:
    """Draw a dimension line from one point to another below the car, with its length."""
    ax.plot([start[0], end[0]], [y, y], "|-", color=COLOURS["truth"], lw=0.8, ms=6)
    ax.annotate(words, ((start[0] + end[0]) / 2, y + 0.03), ha="center", va="bottom", fontsize=8)
