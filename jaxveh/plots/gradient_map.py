"""Maps of a tyre over slip angle and slip ratio: slopes of its forces, and their sensitivities to each coefficient."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.parameter import Parameter, Where, pick, put, resolve
from jaxveh.plots.style import new_figure, style
from jaxveh.plots.tyres import SLIP_ANGLE, SLIP_RATIO, check_tyre
from jaxveh.tyres import AbstractTyre, Contact

POINTS = 121
COLUMNS = 2
COLOUR_MAP = "RdBu_r"
SHARES = (-0.5, 0.5)
"""Contours, as shares of a map's largest value."""

PEAK = "peak"
"""The label of the contour where a slope is zero."""

UNSEEN = "seen in neither force"
ROUNDING = 1e-4


class Map(NamedTuple):
    """One panel: its `title`, the `label` of the colour bar, `values` (slip ratios, slip angles), the label of their `zero`."""

    title: str
    label: str
    values: np.ndarray
    zero: str = ""


def gradient_map(
    law: AbstractTyre,
    load: float,
    where: Where | None = None,
    *,
    slip_angle: float = SLIP_ANGLE,
    slip_ratio: float = SLIP_RATIO,
    figure: Any = None,
) -> Any:
    """Draw maps over slip angle (up to `slip_angle`, rad) and slip ratio (up to `slip_ratio`) of either sign, at `load` (N).

    The first two are the slopes of the longitudinal force over slip ratio and of the lateral force over slip angle: beyond
    their thick line, where they are zero, more slip gives less force. For each coefficient that `where` picks, such as
    `lambda tyre: (tyre.B, tyre.D)`, the sensitivities of both forces to it follow, times the coefficient (times its declared
    scale if it is zero), in N: where a map is white, measurements have no information about it. A force that does not depend on
    the coefficient has no panel. Thin lines are at half the largest value; blue is negative, red positive.

    `law`: a tyre without states; `figure`: the figure to draw into. **Returns** the figure. **Raises** `InputError` for a load or
    a range of slip that is not positive, or if `where` picks something that is not a leaf.
    """
    check_tyre("plots.gradient_map", law)
    check_positive("load", load, "N")
    check_positive("slip_angle", slip_angle, "rad")
    check_positive("slip_ratio", slip_ratio, "-")
    parameters = resolve(law, where)
    angle, ratio = np.linspace(-slip_angle, slip_angle, POINTS), np.linspace(-slip_ratio, slip_ratio, POINTS)
    contact = _grid(angle, ratio, load)
    maps = [*slopes(law, contact), *(one for p in parameters for one in sensitivities(law, contact, p))]
    rows = -(-len(maps) // COLUMNS)
    with style():
        figure = new_figure(0.4 + 2.2 * rows) if figure is None else figure
        axes = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
        for ax, one in zip(axes.flat, maps, strict=False):
            _draw(figure, ax, np.degrees(angle), 100 * ratio, one)
        for ax in axes.flat[len(maps) :]:
            ax.set_visible(False)
        for ax in axes[:, 0]:
            ax.set_ylabel("slip ratio [%]")
        for column in range(COLUMNS):
            last = axes[(len(maps) - 1 - column) // COLUMNS, column]
            last.set_xlabel("slip angle [°]")
            last.tick_params(labelbottom=True)
    return figure


def slopes(law: AbstractTyre, contact: Contact) -> list[Map]:
    """Return dF_x/dkappa in kN/% and dF_y/dalpha in kN/° at contacts, for the forces that the law has."""
    none = _zeros(contact)
    along, _ = _derivatives(law, contact, d_contact=none._replace(slip_ratio=jnp.ones_like(none.slip_ratio)))
    _, across = _derivatives(law, contact, d_contact=none._replace(slip_angle=jnp.ones_like(none.slip_angle)))
    maps = [
        Map("longitudinal force over slip ratio", "dF_x/dκ [kN/%]", along / 1e3 / 100, PEAK),
        Map("lateral force over slip angle", "dF_y/dα [kN/°]", across / 1e3 * np.pi / 180, PEAK),
    ]
    return [one for one in maps if np.any(one.values)]


def sensitivities(law: AbstractTyre, contact: Contact, parameter: Parameter) -> list[Map]:
    """Return the coefficient times the slope of each force over it, N, for forces that depend on it, else one empty map."""
    (leaf,) = pick(law, (parameter,))
    if jnp.ndim(leaf):
        raise InputError(f"{parameter.name} has shape {jnp.shape(leaf)}: must be a scalar to be shown over slips.")
    value = float(leaf)
    amount = value if value else abs(parameter.scale or 1.0)
    found = _derivatives(law, contact, put(_zeros(law), (parameter,), [jnp.asarray(amount, leaf.dtype)]))
    # Names may be long: the colour bar has p, and the title defines p.
    by = "p" if value else f"{amount:g}"
    maps = [
        Map(f"{force}, p = {parameter.name}", f"{by} d{force}/dp [N]", values)
        for force, values in zip(("F_x", "F_y"), found, strict=True)
        if np.any(values)
    ]
    return maps or [Map(f"p = {parameter.name}", "", np.zeros(found[0].shape))]


def _grid(angle: np.ndarray, ratio: np.ndarray, load: float) -> Contact:
    """Return contacts (slip ratios, slip angles) on the grid."""
    angles, ratios = np.meshgrid(angle, ratio)
    wide = lambda values: jnp.asarray(values, float)
    return Contact(slip_angle=wide(angles), slip_ratio=wide(ratios), load=wide(np.full(angles.shape, load)))


def _zeros(tree: Any) -> Any:
    """Return zero tangents, None for leaves without a derivative."""
    return jax.tree.map(jnp.zeros_like, eqx.filter(tree, eqx.is_inexact_array))


@eqx.filter_jit
def _force_derivative(law: AbstractTyre, contact: Contact, d_law: Any, d_contact: Any) -> Any:
    def forces(law, contact):
        found = law.forces(contact)
        return found.F_x, found.F_y

    return eqx.filter_jvp(forces, (law, contact), (d_law, d_contact))[1]


def _derivatives(law: AbstractTyre, contact: Contact, d_law: Any = None, d_contact: Any = None) -> list[np.ndarray]:
    """Return derivatives of F_x and F_y in a direction of law and contact (None: zero), by one program for all directions."""
    shape = np.shape(contact.slip_angle)
    d_law = _zeros(law) if d_law is None else d_law
    d_contact = _zeros(contact) if d_contact is None else d_contact
    # A force that a law does not have is a Python number without a derivative.
    found = [0.0 if one is None else one for one in _force_derivative(law, contact, d_law, d_contact)]
    return [np.broadcast_to(np.asarray(one, np.float64), shape) for one in found]


def _draw(figure: Any, ax: Any, degrees: np.ndarray, percent: np.ndarray, one: Map) -> None:
    reach = float(np.max(np.abs(one.values)))
    ax.set_title(one.title, fontweight="normal")
    ax.grid(visible=False)
    if not reach:
        ax.text(0.5, 0.5, UNSEEN, transform=ax.transAxes, ha="center", va="center", fontsize=7.5, color="#666666")
        return
    mesh = ax.pcolormesh(
        degrees, percent, one.values, cmap=COLOUR_MAP, vmin=-reach, vmax=reach, shading="gouraud", rasterized=True
    )
    ax.contour(degrees, percent, one.values, [share * reach for share in SHARES], colors="#444444", linewidths=0.6)
    # A force that only saturates has a slope of zero up to rounding, of either sign, and gets no line.
    if one.zero and one.values.min() < -ROUNDING * reach:
        line = ax.contour(degrees, percent, one.values, [0.0], colors="#000000", linewidths=1.2)
        ax.clabel(line, fmt=one.zero)
    figure.colorbar(mesh, ax=ax, label=one.label)
