"""The measurements of rig data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxveh._core.errors import check_kind
from jaxveh._core.names import as_names, check_names
from jaxveh.io import RigTable, kit
from jaxveh.plots.rig_fit import COLOUR_MAP, DOTS, QUANTITIES, SLIPS, slip_of
from jaxveh.plots.style import new_figure, style


def rig(rig: RigTable, channels: Sequence[str] | None = None, *, figure: Any = None) -> Any:
    """Draw a panel per channel: the measurements over its slip, or over the other slip if only that varies, coloured by load.

    `channels`: some of the measured ones, all by default. **Returns** the figure; `figure`: the figure to draw into.

    **Raises** `InputError` for a channel that was not measured.
    """
    check_kind("plots.rig: rig", rig, RigTable, "io.read_rig_table reads one.")
    there = [name for name in kit.RIG_CHANNELS if getattr(rig, name) is not None]
    names = there if channels is None else list(as_names(channels))
    check_names("plots.rig", names, there)
    with style():
        figure = new_figure(2.4 * len(names)) if figure is None else figure
        axes = figure.subplots(len(names), 1, squeeze=False)[:, 0]
        shade = None
        for ax, name in zip(axes, names, strict=True):
            quantity, slip = QUANTITIES[name], slip_of(name, rig)
            label, size = SLIPS[slip]
            rows = np.flatnonzero(np.isfinite(getattr(rig, name)))
            rows = rows[:: -(-len(rows) // DOTS)] if len(rows) else rows
            y = getattr(rig, name)[rows] / quantity.size
            shade = ax.scatter(getattr(rig, slip)[rows] * size, y, c=rig.load[rows] / 1e3, cmap=COLOUR_MAP, s=7, lw=0)
            ax.set_xlabel(label)
            ax.set_ylabel(f"{quantity.title} [{quantity.shown}]")
        figure.colorbar(shade, ax=axes, label="load [kN]")
    return figure
