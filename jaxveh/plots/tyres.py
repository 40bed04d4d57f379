"""The behaviour of a tyre: forces over slip at several loads, aligning moment, and forces in combined slip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_positive, word_for
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


class Panel(NamedTuple):
    """A panel's axes in words, and its `lines`: x, y, and settings of matplotlib."""

    x: str
    y: str
    lines: list[tuple[Any, Any, dict[str, Any]]]


def tyre(law: AbstractTyre, loads: Sequence[float] = LOADS, *, speed: float = SPEED, figure: Any = None) -> Any:
    """Draw the forces of a tyre over slip, and in combined slip.

    Lateral force and aligning moment over slip angle, and longitudinal force over slip ratio, are at `loads` (N); lateral over
    longitudinal force is at several slip angles and the middle load; all are at a forward `speed` (m/s). What the law does not
    have, such as the aligning moment of a lateral law, has no panel. A tyre with states is in its steady state. **Returns** the
    figure; `figure`: the figure to draw into. **Raises** `InputError` for loads or a speed that are not positive, no load, or
    several tyres.
    """
    check_tyre("plots.tyre", law)
    loads = np.atleast_1d(loads).tolist()
    if not loads:
        raise InputError("plots.tyre: loads are empty: give at least one load (N).")
    for load in loads:
        check_positive("loads", load, "N")
    check_positive("speed", speed, "m/s")
    across, along, moment = _over_slip(law, loads, speed)
    both = _varies(across) and _varies(along)
    panels = [panel for panel in (across, along, moment) if _varies(panel)] or [across]
    if both:
        panels.append(_combined(law, loads[len(loads) // 2], speed))
    rows, columns = (2, 2) if len(panels) == 4 else (1, len(panels))
    with style():
        figure = new_figure(2.6 * rows) if figure is None else figure
        axes = figure.subplots(rows, columns, squeeze=False)
        for ax, panel in zip(axes.flat, panels, strict=True):
            for x, y, settings in panel.lines:
                ax.plot(x, y, **settings)
            ax.set_xlabel(panel.x)
            ax.set_ylabel(panel.y)
        if both:
            axes.flat[-1].legend(title="slip angle", loc="lower center", ncols=2, handlelength=1.4)
        legend(figure, axes.flat[:1])
    return figure


def _over_slip(law: AbstractTyre, loads: Sequence[float], speed: float) -> tuple[Panel, Panel, Panel]:
    """Lateral force, longitudinal force and aligning moment in pure slip, a line for each load."""
    angle, ratio = np.linspace(-SLIP_ANGLE, SLIP_ANGLE, POINTS), np.linspace(-SLIP_RATIO, SLIP_RATIO, POINTS)
    across = Panel("slip angle [°]", "lateral force [kN]", [])
    along = Panel("slip ratio [%]", "longitudinal force [kN]", [])
    moment = Panel("slip angle [°]", "aligning moment [N m]", [])
    for i, load in enumerate(loads):
        settings = {"color": CYCLE[i % len(CYCLE)], "label": f"{load / 1e3:g} kN"}
        lateral, longitudinal = (forces_at(law, load, *slips, speed) for slips in ((angle, 0.0), (0.0, ratio)))
        across.lines.append((np.degrees(angle), lateral.F_y / 1e3, settings))
        along.lines.append((100 * ratio, longitudinal.F_x / 1e3, settings))
        moment.lines.append((np.degrees(angle), lateral.M_z, settings))
    return across, along, moment


def _combined(law: AbstractTyre, load: float, speed: float) -> Panel:
    """Lateral over longitudinal force, a line for each slip angle."""
    panel = Panel("longitudinal force [kN]", f"lateral force [kN] at {load / 1e3:g} kN", [])
    wide = np.linspace(-1.0, 1.0, ROOM)
    for i, degrees in enumerate(COMBINED):
        found = forces_at(law, load, np.radians(degrees), wide, speed)
        shade = str(0.75 - 0.75 * i / len(COMBINED))
        panel.lines.append((found.F_x / 1e3, found.F_y / 1e3, {"color": shade, "label": f"{degrees:g}°"}))
    return panel


def _varies(panel: Panel) -> bool:
    """Whether any of its lines is something else than zero."""
    return any(np.any(np.asarray(y) != 0) for _, y, _ in panel.lines)


def check_tyre(who: str, law: Any) -> None:
    """Raise `InputError` for what is no tyre, and for several tyres in one, as `jax.vmap` returns them."""
    if not isinstance(law, AbstractTyre | AbstractDynamicTyre):
        raise InputError(f"{who}: law = {word_for(law)}: must be a tyre, such as tyres.typical_mf_tyre or car.front.")
    number = jnp.zeros(())
    try:
        found = eqx.filter_eval_shape(_evaluate, law, Contact(number, number, number + 1.0, speed=number + 1.0))
        one = all(getattr(leaf, "shape", ()) == () for leaf in jax.tree.leaves(found))
    except (TypeError, ValueError):
        one = False
    if not one:
        raise InputError(f"{who}: several tyres: must be one, such as jax.tree.map(lambda leaf: leaf[0], tyres).")


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
