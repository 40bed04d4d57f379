"""One figure per chapter: the errors of every method in every scenario, relative to doing nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.sideslip_review.chapters.chapter_tables import NAMES, method_label, names_and_units
from jaxveh.experiments.sideslip_review.chapters.racing import CHAPTERS, ChaptersRaced
from jaxveh.plots import kit, style

STRONG = 8.0
"""Ratio of errors with the full colour."""


TOLD_ALREADY = ("v_y",)
"""Quantities left out of the figures: the ratios of the sideslip are nearly the same."""


def chapter_figures(raced: ChaptersRaced) -> dict[str, Any]:
    """Figures by the stems of their files; a chapter without results has none."""
    found = {}
    for chapter, names in CHAPTERS.items():
        labels, ratios = error_ratios(raced, names)
        if labels:
            found[f"chapter_{chapter.replace(',', '').replace(' ', '_')}"] = _map(chapter, labels, ratios)
    return found


def error_ratios(raced: ChaptersRaced, names: tuple[str, ...]) -> tuple[list[str], np.ndarray]:
    """Labels of methods, and medians over seeds of their RMSE over that of doing nothing (methods, scenarios); NaN if there
    is none."""
    labels, rows = [], []
    for quantity, shown, _, _ in names_and_units(raced, names):
        if shown in TOLD_ALREADY:
            continue
        nothing = raced.nothing[quantity, shown]["rmse"]
        for key, values in raced.found.items():
            if key[0] != quantity or key[2] != shown:
                continue
            ratio = np.where(nothing > 0.0, values["rmse"] / np.where(nothing > 0.0, nothing, 1.0), np.nan)
            there = np.isfinite(ratio)
            rows.append(
                [np.median(row[here]) if here.any() else np.nan for row, here in zip(ratio, there, strict=True)]
            )
            labels.append(f"{shown}: {method_label(quantity, key[1])}")
    return labels, np.array(rows)


def _map(chapter: str, labels: list[str], ratios: np.ndarray) -> Any:
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 1.4 + 0.16 * len(labels)), layout="constrained")
    with style():
        axes = figure.subplots()
        with np.errstate(divide="ignore"):
            levels = np.log2(ratios)
        mesh = axes.pcolormesh(
            np.ma.masked_invalid(levels), cmap="RdYlGn_r", vmin=-np.log2(STRONG), vmax=np.log2(STRONG)
        )
        for (row, column), ratio in np.ndenumerate(ratios):
            if np.isfinite(ratio):
                axes.text(column + 0.5, row + 0.5, f"{ratio:.2g}", ha="center", va="center", fontsize=5)
        axes.set_yticks(np.arange(len(labels)) + 0.5, labels, fontsize=6)
        axes.set_xticks(np.arange(len(NAMES)) + 0.5, NAMES, fontsize=6, rotation=35, ha="right")
        axes.invert_yaxis()
        axes.set_title(f"{chapter}: median error over that of doing nothing (* is recommended)", fontsize=8)
        ticks = (-3, -2, -1, 0, 1, 2, 3)
        bar = figure.colorbar(mesh, ax=axes, ticks=ticks, pad=0.01, aspect=40)
        bar.ax.set_yticklabels([f"{2.0**tick:g}" for tick in ticks], fontsize=6)
        bar.set_label("ratio of RMSE [-]", fontsize=6)
    return figure
