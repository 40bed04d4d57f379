"""Estimated parameters against the truth, all on one scale: the prior's standard deviation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_kind, check_positive
from jaxveh._core.names import check_names
from jaxveh.plots.estimates import BAND
from jaxveh.plots.style import COLOURS, colour, legend, new_figure, style


def parameters(
    truth: Mapping[str, Any],
    mean: Mapping[str, Mapping[str, Any]],
    std: Mapping[str, Mapping[str, Any]],
    *,
    scale: Mapping[str, Any],
    figure: Any = None,
) -> Any:
    """Draw each estimator's deviation from the truth, a row per parameter, in prior standard deviations with 95 % bars.

    **Arguments**, each a number by a parameter's name (`front.B`), such as the `Parameters` of a fit or the last row of those
    of an estimate: `truth`; `mean`, `std`: of each estimator by its label; `scale`: the prior's standard deviations, positive.
    `figure`: the figure to draw into.

    **Returns** the figure. **Raises** `InputError` for names that do not agree.
    """
    for what, given in (("truth", truth), ("mean", mean), ("std", std), ("scale", scale)):
        check_kind(f"plots.parameters: {what}", given, Mapping, "From names to numbers.")
    names = tuple(truth)
    truths, scales = _numbers("truth", truth, names), _numbers("scale", scale, names)
    check_positive("scale", scales)
    means = {label: _numbers(f"mean of {label}", values, names) for label, values in mean.items()}
    spreads = {label: _numbers(f"std of {label}", std[label], names) for label in mean}
    count, labels = len(names), list(mean)
    offsets = np.linspace(-0.3, 0.3, len(labels)) if len(labels) > 1 else np.zeros(1)
    rows = np.arange(count)
    with style():
        figure = new_figure(0.9 + 0.42 * count) if figure is None else figure
        ax = figure.subplots()
        ax.axvline(0, color=COLOURS["truth"], lw=1.2, zorder=1.5)
        for index, (label, offset) in enumerate(zip(labels, offsets, strict=True)):
            deviation = (means[label] - truths) / scales
            reach = BAND * spreads[label] / scales
            ax.errorbar(deviation, rows + offset, xerr=np.nan_to_num(reach), fmt="o", ms=3.4, lw=1.0, capsize=0,
                        color=colour(label, index), label=label)  # fmt: skip
        for row in rows[:-1]:
            ax.axhline(row + 0.5, color="#e6e6e6", lw=0.6)
        ax.set_yticks(rows, [f"{name}  ({value:.5g})" for name, value in zip(names, truths, strict=True)])
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        ax.set_ylim(count - 0.5, -0.5)
        ax.set_xlabel("estimate − truth, in prior standard deviations, bars 95 %")
        ax.set_ylabel("parameter (truth)")
        legend(figure, ax)
    return figure


def _numbers(what: str, values: Mapping[str, Any], names: tuple[str, ...]) -> np.ndarray:
    """Return the numbers (p,) of these names; raise `InputError` for other or missing names."""
    check_names(f"plots.parameters: {what}", values, names)
    missing = [name for name in names if name not in values]
    if missing:
        raise InputError(f"plots.parameters: {what} has no {', '.join(missing)}; truth has: {', '.join(names)}.")
    numbers = {name: np.asarray(values[name], dtype=np.float64) for name in names}
    for name, number in numbers.items():
        if number.ndim:
            raise InputError(
                f"plots.parameters: {what}: {name} has shape {number.shape}: must be one number, such as a last row."
            )
    return np.array(list(numbers.values()))
