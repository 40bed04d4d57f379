"""Estimated parameters against the truth, all on one scale: the prior's standard deviation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh.plots.estimates import BAND
from jaxveh.plots.style import COLOURS, colour, legend, new_figure, style


def parameters(
    names: Sequence[str],
    truth: Any,
    mean: Mapping[str, Any],
    std: Mapping[str, Any],
    *,
    scale: Any,
    figure: Any = None,
) -> Any:
    """A row a parameter, a dot an estimator: its deviation from the truth in prior standard deviations, with 95 % bars.

    **Arguments**: `names` (p,), such as `front.B`; `truth` (p,); `mean`, `std`: label to (p,) values and standard
    deviations; `scale` (p,): the prior's standard deviations, positive. `figure`: where to draw.

    **Returns** the figure. **Raises** `InputError` for lengths that do not agree.
    """
    truth, scale = np.asarray(truth, dtype=np.float64), np.asarray(scale, dtype=np.float64)
    count, labels = len(names), list(mean)
    for what, values in {
        "truth": truth,
        "scale": scale,
        **{f"mean of {k}": np.asarray(v) for k, v in mean.items()},
    }.items():
        if values.shape != (count,):
            raise InputError(f"plots.parameters: {what} has shape {values.shape}; must be ({count},) for the names.")
    check_positive("scale", scale)
    offsets = np.linspace(-0.3, 0.3, len(labels)) if len(labels) > 1 else np.zeros(1)
    rows = np.arange(count)
    with style():
        figure = new_figure(0.9 + 0.42 * count) if figure is None else figure
        ax = figure.subplots()
        ax.axvline(0, color=COLOURS["truth"], lw=1.2, zorder=1.5)
        for index, (label, offset) in enumerate(zip(labels, offsets, strict=True)):
            deviation = (np.asarray(mean[label], dtype=np.float64) - truth) / scale
            reach = BAND * np.asarray(std[label], dtype=np.float64) / scale
            ax.errorbar(deviation, rows + offset, xerr=np.nan_to_num(reach), fmt="o", ms=3.4, lw=1.0, capsize=0,
                        color=colour(label, index), label=label)  # fmt: skip
        for row in rows[:-1]:
            ax.axhline(row + 0.5, color="#e6e6e6", lw=0.6)
        ax.set_yticks(rows, [f"{name}  ({value:.5g})" for name, value in zip(names, truth, strict=True)])
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        ax.set_ylim(count - 0.5, -0.5)
        ax.set_xlabel("estimate − truth, in prior standard deviations, bars 95 %")
        ax.set_ylabel("parameter (truth)")
        legend(figure, ax)
    return figure
