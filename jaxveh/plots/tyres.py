"""The behaviour of a tyre: forces over slip at several loads, aligning moment, and forces in combined slip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh.plots.style import CYCLE, legend, new_figure, style
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact

POINTS = 181
SLIP_ANGLE = np.radians(18.0)
SLIP_RATIO = 0.3
ROOM = 4 * POINTS
"""Number of points of the longest line; every line is computed with this many."""
COMBINED = (1.0, 2.0, 4.0, 10.0)
"""Slip angles whose forces in combined slip are drawn, degrees."""


LOADS = (2000.0, 4000.0, 6000.0)
"""Default loads, N."""

SPEED = 16.7
"""Default speed, m/s: that of most rigs."""


def tyre(law: AbstractTyre, loads: Sequence[float] = LOADS, *, speed: float = SPEED, figure: Any = None) -> Any:
    """Draw the forces of a tyre over slip, and in combined slip.

    Lateral force and aligning moment over slip angle, and longitudinal force over slip ratio, are at `loads` (N); lateral over
    longitudinal force is at several slip angles and the middle load; all are at a forward `speed` (m/s). A tyre with states is
    in its steady state. **Returns** the figure; `figure`: the figure to draw into.
    """
    angle, ratio = np.linspace(-SLIP_ANGLE, SLIP_ANGLE, POINTS), np.linspace(-SLIP_RATIO, SLIP_RATIO, POINTS)
    with style():
        figure = new_figure(5.2) if figure is None else figure
        axes = figure.subplots(2, 2)
        for i, load in enumerate(loads):
            settings = {"color": CYCLE[i % len(CYCLE)], "label": f"{load / 1e3:g} kN"}
            across, along = (forces_at(law, load, *slips, speed) for slips in ((angle, 0.0), (0.0, ratio)))
            axes[0, 0].plot(np.degrees(angle), across.F_y / 1e3, **settings)
            axes[0, 1].plot(100 * ratio, along.F_x / 1e3, **settings)
            axes[1, 0].plot(np.degrees(angle), across.M_z, **settings)
        middle = loads[len(loads) // 2]
        wide = np.linspace(-1.0, 1.0, 4 * POINTS)
        for i, degrees in enumerate(COMBINED):
            found = forces_at(law, middle, np.radians(degrees), wide, speed)
            shade = str(0.75 - 0.75 * i / len(COMBINED))
            axes[1, 1].plot(found.F_x / 1e3, found.F_y / 1e3, color=shade, label=f"{degrees:g}°")
        axes[1, 1].legend(title="slip angle", loc="lower center", ncols=2, handlelength=1.4)
        for ax, x, y in (
            (axes[0, 0], "slip angle [°]", "lateral force [kN]"),
            (axes[0, 1], "slip ratio [%]", "longitudinal force [kN]"),
            (axes[1, 0], "slip angle [°]", "aligning moment [N m]"),
            (axes[1, 1], "longitudinal force [kN]", f"lateral force [kN] at {middle / 1e3:g} kN"),
        ):
            ax.set_xlabel(x)
            ax.set_ylabel(y)
        legend(figure, axes[:1])
    return figure


def forces_at(law: AbstractTyre, load: float, slip_angle: Any, slip_ratio: Any, speed: float | None = None) -> Any:
    """Return forces at a load (N) as NumPy arrays of the shape to which slip angles (rad) and slip ratios broadcast."""
    shape = np.broadcast_shapes(np.shape(slip_angle), np.shape(slip_ratio))
    # Lines of different lengths use the same compiled program.
    size = (max(ROOM, *shape),) if len(shape) == 1 else shape
    wide = lambda value: jnp.asarray(np.resize(np.broadcast_to(value, shape), size), float)
    settings = {} if speed is None else {"speed": jnp.asarray(speed, float)}
    found = _evaluate(
        law,
        Contact(slip_angle=wide(slip_angle), slip_ratio=wide(slip_ratio), load=jnp.asarray(load, float), **settings),
    )
    shown = tuple(slice(0, count) for count in shape)
    return jax.tree.map(lambda value: np.broadcast_to(np.asarray(value), size)[shown], found)


@eqx.filter_jit
def _evaluate(law: AbstractTyre, contact: Contact) -> Any:
    return law.forces(contact, law.start(contact)) if isinstance(law, AbstractDynamicTyre) else law.forces(contact)
