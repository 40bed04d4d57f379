"""Figures of the further parts: drives beyond the peak, and both particle filters over the sensors' noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.tyre_apf.saturated import Saturated
from jaxveh.experiments.tyre_apf.settings import LEVELS
from jaxveh.experiments.tyre_apf.sharpness import PAPERS_PARTICLES, SYSTEMATIC, Sharpness
from jaxveh.plots import COLOURS, kit, style

MARKS = {"prior": "s", "UKF": "o", "MAP": "D"}

ASIDE = 0.09
"""Distance between marks that belong to one place on the axis."""


def saturated_figure(found: Saturated) -> Any:
    """Root mean square errors of the parameters beside the Cramer-Rao bound: one column per drive, one row per set of
    unknowns."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 1.2 + 2.1 * len(found.found)), layout="constrained")
    with style():
        panels = figure.subplots(len(found.found), len(found.cases), squeeze=False, sharey="row")
        for row, (unknown, runs) in zip(panels, found.found.items(), strict=True):
            for i, (axes, case) in enumerate(zip(row, found.cases, strict=True)):
                seen = found.bounds[unknown][case]
                place = np.arange(len(seen.names))
                axes.hlines(
                    100 * seen.bounds.array(), place - 0.35, place + 0.35, color="#000000", label="Cramér-Rao bound"
                )
                names = runs.design.axis("estimator").labels
                for j, name in enumerate(names):
                    rms = 100 * np.sqrt(np.mean(runs.at("error", estimator=name)[i] ** 2, axis=0))
                    x = place + 2 * ASIDE * (j - 0.5 * (len(names) - 1))
                    axes.plot(x, rms, MARKS[name], color=COLOURS[name], markersize=4, label=name)
                labels = [name.replace("front.", "f.").replace("rear.", "r.") for name in seen.names]
                axes.set(yscale="log", title=f"{case}: {unknown}", xticks=place, xticklabels=labels)
            row[0].set(ylabel="RMSE [% (E: hundredths)]")
        every = {name: mark for ax in panels.flat for mark, name in zip(*ax.get_legend_handles_labels(), strict=True)}
        figure.legend(every.values(), every.keys(), loc="outside lower center", ncols=4)
    return figure


def sharpness_figure(found: Sharpness) -> Any:
    """Errors of the eight parameters, and the range of the log-likelihood, over the sensors' noise: medians and quartiles."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.4), layout="constrained")
    places = np.arange(len(LEVELS))
    with style():
        left, right = figure.subplots(1, 2)
        prior = next(iter(found.found.values())).at("error", filter="prior")
        left.plot(places, np.median(prior, axis=-1), color=COLOURS["prior"], linestyle="--", label="prior")
        groups = [(n, c, runs) for c, runs in found.found.items() for n in runs.design.axis("filter").labels[1:]]
        for i, (name, count, runs) in enumerate(groups):
            colour, paper = COLOURS[name.split(",")[0]], count == PAPERS_PARTICLES
            fill = "white" if name.endswith(SYSTEMATIC) else colour
            line = dict(color=colour, alpha=1.0 if paper else 0.5, marker="o", markersize=4, markerfacecolor=fill)
            x = places + ASIDE * (i - 0.5 * (len(groups) - 1))
            for axes, what in ((left, "error"), (right, "likelihood_spread")):
                low, mid, high = np.quantile(runs.at(what, filter=name), [0.25, 0.5, 0.75], axis=-1)
                label = f"{name}, {count} particles"
                axes.errorbar(x, mid, (mid - low, high - mid), **line, linestyle="none", capsize=2, label=label)
        labels = [f"{level.yaw_rate:g} rad/s\n{level.a_y:g} m/s²" for level in LEVELS]
        for axes in (left, right):
            axes.set(xticks=places, xticklabels=labels, xlabel="noise of yaw rate and lateral acceleration")
            axes.margins(x=0.08)
        left.set(ylabel="RMSE [prior standard deviations]", title="Eight parameters", ylim=(0, None))
        right.set(ylabel="interquartile range [-]", yscale="log", title="Log-likelihood over passes of one drive")
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
