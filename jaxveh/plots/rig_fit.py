"""A fit to rig data: measured and fitted values, and residuals over slip and load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import check_kind, check_one_of
from jaxveh._core.names import as_names
from jaxveh.fitting import RigFit, kit
from jaxveh.io import RigTable
from jaxveh.plots.style import new_figure, style

HEIGHT = 4.3
"""Height of a channel's four panels, inches."""

DOTS = 4000
"""Largest number of rows that are drawn, evenly over the data; means and histograms use all."""

GROUPS = 20
"""Number of groups of rows whose mean residual is drawn."""

TAIL = 5.0
"""Half the width of the histogram, standard deviations."""

COLOUR_MAP = "viridis"


class FittedQuantity(NamedTuple):
    """A channel in words, its unit, the displayed unit, the size of the displayed unit, and the slip over which it is drawn."""

    title: str
    unit: str
    shown: str
    size: float
    slip: str


QUANTITIES = {
    "F_x": FittedQuantity("longitudinal force", "N", "kN", 1e3, "slip_ratio"),
    "F_y": FittedQuantity("lateral force", "N", "kN", 1e3, "slip_angle"),
    "M_x": FittedQuantity("overturning moment", "N m", "N m", 1.0, "slip_angle"),
    "M_y": FittedQuantity("rolling moment", "N m", "N m", 1.0, "slip_ratio"),
    "M_z": FittedQuantity("aligning moment", "N m", "N m", 1.0, "slip_angle"),
}

SLIPS = {"slip_angle": ("slip angle [°]", np.degrees(1.0)), "slip_ratio": ("slip ratio [%]", 100.0)}
"""Labels of slips on an axis, and the factors from SI."""


def rig_fit(fit: RigFit, rig: RigTable, channels: Sequence[str] | None = None, *, figure: Any = None) -> Any:
    """Draw a fit to rig data, in four panels per channel.

    They are measured values (coloured by load) and fitted ones (black) over slip, residuals (fitted less measured) over slip and
    over load with their mean in groups of rows, and their histogram next to a normal law of the same standard deviation.

    `fit` of `fitting.fit_rig` and the `rig` that it was given; `channels`: some of the fit's, all by default. A trend in the mean
    is a part of the data that the law cannot follow; noise has none. **Returns** the figure; `figure`: the figure to draw into.

    **Raises** `InputError` for a channel that was not fitted.
    """
    check_kind("plots.rig_fit: fit", fit, RigFit, "fitting.fit_rig returns one.")
    check_kind("plots.rig_fit: rig", rig, RigTable, "io.read_rig_table reads one.")
    chosen = tuple(fit.rmse) if channels is None else as_names(channels)
    for name in chosen:
        check_one_of("channels", name, tuple(fit.rmse))
    with style():
        figure = new_figure(HEIGHT * len(chosen)) if figure is None else figure
        blocks = figure.subfigures(len(chosen), 1, squeeze=False)[:, 0]
        for block, name in zip(blocks, chosen, strict=True):
            _channel(block, name, fit, rig)
    return figure


def slip_of(name: str, rig: RigTable) -> str:
    """Return the slip over which a channel is drawn: its own, or the other one if only that varies."""
    own = QUANTITIES[name].slip
    varies = kit.varying_inputs(rig)
    other = "slip_angle" if own == "slip_ratio" else "slip_ratio"
    return other if own not in varies and other in varies else own


def _channel(block: Any, name: str, fit: RigFit, rig: RigTable) -> None:
    quantity, slip = QUANTITIES[name], slip_of(name, rig)
    residual = fit.residuals[name]
    there = np.isfinite(residual)
    residual, load = residual[there], rig.load[there]
    measured = getattr(rig, name)[there]
    label, size = SLIPS[slip]
    x = getattr(rig, slip)[there] * size
    rows = slice(None, None, -(-len(x) // DOTS))
    axes = block.subplots(2, 2)
    block.suptitle(
        f"{name}, {quantity.title}: RMSE {fit.rmse[name]:.3g} {quantity.unit}, "
        f"{100 * fit.rmse[name] / fit.peak[name]:.2g} % of peak",
        x=0.01, ha="left", fontsize=9.0, fontweight="bold",
    )  # fmt: skip
    dots = {"c": load[rows] / 1e3, "cmap": COLOUR_MAP, "s": 7, "lw": 0, "rasterized": True}
    axes[0, 0].scatter(x[rows], measured[rows] / quantity.size, label="measured", **dots)
    axes[0, 0].plot(
        x[rows], (measured + residual)[rows] / quantity.size, ".", color="#000000", ms=2.0, mew=0, label="fitted", rasterized=True
    )  # fmt: skip
    axes[0, 0].legend(loc="best", handletextpad=0.2, markerscale=2.0)
    shade = axes[0, 1].scatter(x[rows], residual[rows], **dots)
    axes[1, 0].scatter(load[rows] / 1e3, residual[rows], **dots)
    axes[1, 0].margins(x=0.04)
    for ax, over in ((axes[0, 1], x), (axes[1, 0], load / 1e3)):
        ax.axhline(0.0, color="#444444", lw=0.6)
        ax.plot(*group_means(over, residual), "-o", color="#d55e00", lw=1.2, ms=2.5, label="mean of neighbours")
    axes[1, 0].legend(loc="best")
    _histogram(axes[1, 1], residual)
    block.colorbar(shade, ax=axes[0, 1], label="load [kN]")
    left, full = f"residual [{quantity.unit}]", f"residual: fitted less measured [{quantity.unit}]"
    for ax, horizontal, vertical in (
        (axes[0, 0], label, f"{quantity.title} [{quantity.shown}]"),
        (axes[0, 1], label, left),
        (axes[1, 0], "load [kN]", left),
        (axes[1, 1], full, "share of rows [%]"),
    ):
        ax.set_xlabel(horizontal)
        ax.set_ylabel(vertical)


def group_means(x: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of x and of residuals in groups of neighbours: one per value if x has few values, else of equal size."""
    order = np.argsort(x, kind="stable")
    x, residual = x[order], residual[order]
    edges = np.flatnonzero(np.diff(x)) + 1
    if len(edges) >= GROUPS:
        # An edge between equal values is moved before all of them; many equal values, as in pure slip, are a separate group.
        middle = np.linspace(0, len(x), GROUPS + 1).astype(int)[1:-1]
        first, last = (np.searchsorted(x, x[middle], side) for side in ("left", "right"))
        edges = np.unique(np.concatenate([first, last[last - first > len(x) / GROUPS]]))
    parts = [
        (np.mean(a), np.mean(b)) for a, b in zip(np.split(x, edges), np.split(residual, edges), strict=True) if a.size
    ]
    return tuple(np.array(parts).T)  # type: ignore[return-value]


def _histogram(ax: Any, residual: np.ndarray) -> None:
    spread = float(np.sqrt(np.mean(residual**2))) or 1.0
    reach = TAIL * spread
    bins = np.linspace(-reach, reach, 41)
    width, share = bins[1] - bins[0], 100.0 / residual.size
    ax.hist(residual, bins, weights=np.full(residual.shape, share), color="#56b4e9", label="residuals")
    at = np.linspace(-reach, reach, 201)
    normal = 100 * width * np.exp(-0.5 * (at / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
    ax.plot(at, normal, color="#000000", lw=1.0, label="normal law")
    ax.margins(y=0.15)
    ax.locator_params(axis="x", nbins=6)
    beyond = int(np.sum(np.abs(residual) > reach))
    if beyond:
        ax.text(0.98, 0.6, f"{beyond} beyond", transform=ax.transAxes, ha="right", fontsize=7.5, color="#666666")
    ax.legend(loc="upper right")
