"""One style for all figures: colours that colour-blind readers can distinguish, thin lines, no frame, units on each axis."""

from __future__ import annotations

import contextlib
import io as streams
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_has, path_of
from jaxveh.io import kit, replacing_file

# M. Okabe and K. Ito, Color Universal Design (2008); the truth is black.
COLOURS = {
    "truth": "#000000",
    "prior": "#7f7f7f",
    "PF": "#cc79a7",
    "APF": "#009e73",
    "UKF": "#0072b2",
    "MAP": "#d55e00",
}
"""Colours by role; series without a role take those of `CYCLE` in turn."""

CYCLE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of series without a role."""
SHADE = "#f7f1df"
"""The colour of shaded spans of time."""

PAGE_WIDTH = 7.2
"""Width of a page's text, inches."""

DPI = 150

WORDS = 125
"""Number of letters of a legend's line that fit on a page's width; each mark counts as 7."""

SUFFIXES = (".png", ".svg", ".pdf")

_RC = {
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.edgecolor": "#444444",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.xmargin": 0.01,
    "axes.formatter.useoffset": False,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "svg.fonttype": "none",
    "svg.hashsalt": "jaxveh",
    "figure.constrained_layout.use": True,
}


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Apply the matplotlib settings of this package's figures, and restore the old ones at the end; also for your own figures."""
    matplotlib = kit.require("matplotlib", "drawing figures", "plot")
    with matplotlib.rc_context(_RC):
        yield


def new_figure(height: float, width: float = PAGE_WIDTH) -> Any:
    """Return an empty figure of this package's class, with size in inches; it needs no window and no pyplot."""
    kit.require("matplotlib", "drawing figures", "plot")
    from jaxveh.plots.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def save(figure: Any, path: str | os.PathLike, *, dpi: int = DPI) -> Path:
    """Write a figure as `.png`, `.svg` or `.pdf`, completely or not at all, replacing an older one; return the path.

    **Raises** `InputError` for another suffix, or if the file cannot be written.
    """
    check_has("plots.save: figure", figure, ("savefig",), "The plots of this room return one.")
    path = path_of(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: suffix {path.suffix!r}; a figure must end in one of {', '.join(SUFFIXES)}.")
    content = streams.BytesIO()
    # Without a date, equal figures give equal files.
    metadata = {"Software": None} if path.suffix.lower() == ".png" else {"Date": None}
    if path.suffix.lower() == ".pdf":
        metadata = {"CreationDate": None}
    with style():
        figure.savefig(content, format=path.suffix[1:].lower(), dpi=dpi, metadata=metadata)
    with replacing_file(path, overwrite=True) as part:
        part.write_bytes(content.getvalue())
    return path


def colour(name: str, index: int = 0) -> str:
    """Return the colour of a role, otherwise the next colour of the cycle."""
    return COLOURS.get(name, CYCLE[index % len(CYCLE)])


def legend(figure: Any, axes: Any) -> Any:
    """Draw one legend for the whole figure above the data, each label once, in the order of drawing; None without labels."""
    entries: dict[str, Any] = {}
    for ax in _flat(axes):
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return None
    # As many columns as the labels leave room for; each column is as wide as its longest label.
    columns, letters = min(len(entries), 8), [len(label) for label in entries]
    while columns > 1 and sum(max(part) + 7 for part in np.array_split(letters, columns)) > WORDS:
        columns -= 1
    return figure.legend(
        entries.values(), entries.keys(), loc="outside upper left", ncols=columns, handlelength=1.6,
        columnspacing=1.2, borderaxespad=0.2,
    )  # fmt: skip


def label_above(ax: Any, label: str) -> None:
    """Write the label of the y axis above the panel: it is horizontal, and low panels have no room beside them."""
    ax.set_title(label, loc="left", fontweight="normal", pad=3.0)


def _flat(axes: Any) -> Iterable[Any]:
    return axes.flat if hasattr(axes, "flat") else axes if isinstance(axes, list | tuple) else [axes]
