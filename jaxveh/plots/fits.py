"""Fitted parameters with their standard errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_kind
from jaxveh._core.names import check_names
from jaxveh.plots.estimates import BAND
from jaxveh.plots.style import COLOURS, CYCLE, new_figure, style

MOST = 40
"""Largest number of rows on a page."""


def fit(fit: Any, truth: Mapping[str, Any] | None = None, *, figure: Any = None) -> Any:
    """Draw the deviation of each parameter from its `truth` (by name), a row each, with its 95 % bar, in per cent of the truth.

    Without a truth only the bars are drawn, in per cent of the value. A parameter without a standard error has no bar.

    **Arguments**: `fit`: anything with `parameters` and `parameters_std`, such as a fit, or `Parameters` themselves, of one
    number each. `figure`: the figure to draw into.

    **Returns** the figure. **Raises** `InputError` for arrays, more than 40 parameters, or a truth without one of them.
    """
    value = getattr(fit, "parameters", fit) if not isinstance(fit, Mapping) else fit
    check_kind("plots.fit: fit", value, Mapping, "A fit, or the Parameters of one.")
    if truth is not None:
        check_kind("plots.fit: truth", truth, Mapping, "Such as {'front.B': 10.0}.")
    std = {} if value is fit else fit.parameters_std
    names = list(value)
    if not names or len(names) > MOST or any(np.ndim(value[name]) for name in names):
        raise InputError(f"plots.fit: {len(names)} parameters: must be 1 to {MOST}, of one number each.")
    check_names("plots.fit: truth", names if truth is not None else (), truth or ())
    numbers = np.array([float(value[name]) for name in names])
    reference = numbers if truth is None else np.array([float(truth[name]) for name in names])
    scale = np.where(reference == 0, 1.0, np.abs(reference)) / 100
    reach = BAND * np.array([float(std.get(name, np.nan)) for name in names]) / scale
    rows = np.arange(len(names))
    with style():
        figure = new_figure(0.9 + 0.36 * len(names)) if figure is None else figure
        ax = figure.subplots()
        ax.axvline(0, color=COLOURS["truth"], lw=1.2, zorder=1.5)
        ax.errorbar((numbers - reference) / scale, rows, xerr=np.nan_to_num(reach), fmt="o", ms=3.4, lw=1.0, capsize=0,
                    color=CYCLE[0])  # fmt: skip
        ax.set_yticks(rows, [f"{name}  ({number:.5g})" for name, number in zip(names, numbers, strict=True)])
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        ax.set_ylim(len(names) - 0.5, -0.5)
        of = "truth, in % of it" if truth is not None else "value, in % of it"
        ax.set_xlabel(f"deviation from the {of}, bars 95 %")
        ax.set_ylabel("parameter (value)")
    return figure
