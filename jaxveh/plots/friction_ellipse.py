"""The limits of a tyre: lateral over longitudinal force in combined slip, and the limit around them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_finite, check_positive, word_for
from jaxveh.plots.style import COLOURS, legend, new_figure, style
from jaxveh.plots.tyres import check_tyre, forces_at
from jaxveh.tyres import AbstractTyre

POINTS = 301
SLIP_ANGLE = np.radians(20.0)
SLIP_ANGLES = tuple(np.radians((1.0, 2.0, 4.0, 8.0, 16.0)))
DIRECTIONS = 120
"""Number of sectors around the origin; the largest force of each is on the limit."""

BEND = 4.0
"""Parameter of the density of slips, which is higher at zero, where the direction of the force changes fastest."""


def friction_ellipse(
    law: AbstractTyre,
    load: float,
    slip_angles: Sequence[float] = SLIP_ANGLES,
    *,
    slip_angle: float = SLIP_ANGLE,
    slip_ratio: float = 1.0,
    figure: Any = None,
) -> Any:
    """Draw lateral over longitudinal force at slip angles of either sign, the limit, and the ellipse of the pure peaks.

    The limit is the largest force in each direction over all slips up to `slip_angle` (rad) and `slip_ratio` (-) of either
    sign. The ellipse, in four quarters, passes through the peaks of pure slip: where the limit differs from it, the law's
    combined slip is not an ellipse.

    **Arguments**: `law`: a tyre without states; `load` (N); `slip_angles` (rad), not negative: each has a curve for either sign.
    `figure`: the figure to draw into. **Returns** the figure. **Raises** `InputError` for a load or a range of slip that is not
    positive, a negative slip angle, or a law without one of the two forces.
    """
    check_tyre("plots.friction_ellipse", law)
    _check(load, slip_angles, slip_angle, slip_ratio)
    ratio = slip_ratio * _dense_at_zero()
    grid = forces_at(law, load, slip_angle * _dense_at_zero()[:, None], ratio[None, :])
    for name, values in (("longitudinal", grid.F_x), ("lateral", grid.F_y)):
        if not np.any(values):
            raise InputError(f"plots.friction_ellipse: law = {word_for(law)} has no {name} force; it must have both.")
    with style():
        from matplotlib import colormaps

        figure = new_figure(6.0) if figure is None else figure
        ax = figure.subplots()
        for i, angle in enumerate(slip_angles):
            shade = colormaps["viridis"](0.92 - 0.92 * i / max(len(slip_angles) - 1, 1))
            for sense in (1.0, -1.0) if angle else (1.0,):
                found = forces_at(law, load, sense * angle, ratio)
                ax.plot(found.F_x / 1e3, found.F_y / 1e3, color=shade, label=_label(i, angle))
        F_x, F_y = limit(grid.F_x, grid.F_y)
        ax.plot(F_x / 1e3, F_y / 1e3, color=COLOURS["truth"], lw=1.8, label="limit")
        # Zero slip is the middle of an odd number of points.
        F_x, F_y = ellipse(grid.F_x[POINTS // 2], grid.F_y[:, POINTS // 2])
        ax.plot(F_x / 1e3, F_y / 1e3, "--", color=COLOURS["prior"], lw=1.0, label="ellipse of the pure peaks")
        ax.set_aspect("equal", adjustable="datalim")
        _square_grid(ax, float(np.max(np.hypot(F_x, F_y))) / 1e3)
        ax.set_xlabel(f"longitudinal force [kN] at a load of {load / 1e3:g} kN")
        ax.set_ylabel("lateral force [kN]")
        legend(figure, ax)
    return figure


def limit(F_x: Any, F_y: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest force in each of `DIRECTIONS` sectors around the origin, as a closed curve without empty sectors.

    `F_x`, `F_y` (N): arrays of one shape. The returned forces are among them, not at the middles of the sectors.
    """
    F_x, F_y = np.ravel(F_x), np.ravel(F_y)
    sector = np.floor(DIRECTIONS * (np.arctan2(F_y, F_x) / (2 * np.pi) + 0.5)).astype(int) % DIRECTIONS
    # The last entry of a sector wins, so the largest force comes last.
    order = np.argsort(np.hypot(F_x, F_y), kind="stable")
    greatest = dict(zip(sector[order].tolist(), order.tolist(), strict=True))
    at = [greatest[one] for one in sorted(greatest)]
    return F_x[at + at[:1]], F_y[at + at[:1]]


def ellipse(F_x: Any, F_y: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the ellipse, in four quarters, through the peaks of F_x and F_y (N) of either sign."""
    turn = np.linspace(0.0, 2 * np.pi, 4 * POINTS)
    x, y = np.cos(turn), np.sin(turn)
    return np.where(x > 0, np.max(F_x), -np.min(F_x)) * x, np.where(y > 0, np.max(F_y), -np.min(F_y)) * y


def _label(index: int, angle: float) -> str:
    shown = f"±{np.degrees(angle):.3g}°" if angle else "0°"
    return shown if index else f"slip angle {shown}"


def _dense_at_zero() -> np.ndarray:
    """Return points from -1 to 1, denser at zero."""
    return np.sinh(BEND * np.linspace(-1.0, 1.0, POINTS)) / np.sinh(BEND)


def _square_grid(ax: Any, reach: float) -> None:
    """Set the same ticks on both axes, so that squares of the grid look like squares."""
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    low, high = MaxNLocator(10, steps=[1, 2, 5, 10]).tick_values(-reach, reach)[:2]
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(high - low))


def _check(load: float, slip_angles: Sequence[float], slip_angle: float, slip_ratio: float) -> None:
    check_positive("load", load, "N")
    check_positive("slip_angle", slip_angle, "rad")
    check_positive("slip_ratio", slip_ratio, "-")
    check_finite("slip_angles", np.asarray(slip_angles, float))
    if min(slip_angles, default=0.0) < 0:
        raise InputError(
            f"slip_angles = {min(slip_angles):g}: must be at least 0 (rad); each is drawn with either sign."
        )
