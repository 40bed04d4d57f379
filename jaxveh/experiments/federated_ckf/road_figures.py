"""Figures of the speeds, and of the friction under each wheel on roads with several frictions."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.federated_ckf.study import Raced
from jaxveh.plots import COLOURS, kit, style

EVERY = 0.1
"""s between the rows that are kept."""

MUS = {
    "first guess": COLOURS["prior"],
    "one mu": kit.CYCLE[0],
    "one mu, walking": kit.CYCLE[4],
    "four mu": kit.CYCLE[3],
    "four mu, walking": kit.CYCLE[1],
}
"""The estimators in the figures of the roads, with their colours."""

TICKS = (0.1, 0.2, 0.5, 1.0, 2.0)
WHEELS = ("front left", "front right", "rear left", "rear right")


def speeds_figure(raced: Raced, shown: dict[str, str], case: str = "printed start", seed: int = 0) -> Any:
    """Both speeds of one drive as estimated by each of the `shown` estimators (with its colour), and their errors."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 5.6), layout="constrained")
    place, step = raced.cases.index(case), round(EVERY / raced.study.dt)
    drive = type(raced.drives)(*(leaf[place, seed][::step] for leaf in raced.drives))
    time = EVERY * np.arange(len(drive.true_v_x))
    with style():
        panels = figure.subplots(4, 1, sharex=True)
        for row, (name, true, least) in enumerate((("v_x", drive.true_v_x, 1e-4), ("v_y", drive.true_v_y, 1e-4))):
            for who, colour in shown.items():
                values = raced.at(name, who, case)[seed]
                dashes = (0, (4, 3)) if who == "redesigned" else "-"
                label = who if row == 0 else None
                panels[row].plot(time, values, color=colour, linestyle=dashes, label=label)
                error = np.maximum(np.abs(values - true), least)
                panels[2 + row].plot(time, error, color=colour, linestyle=dashes)
            low, high = true.min(), true.max()
            panels[row].plot(time, true, color=COLOURS["truth"], linewidth=0.8, label="truth" if row == 0 else None)
            panels[row].set(ylabel=f"${name}$ [m/s]", ylim=(low - 0.3 * (high - low), high + 0.3 * (high - low)))
            panels[2 + row].set(ylabel=f"error of ${name}$\n[m/s]", yscale="log", ylim=(1e-4, 1.0))
        panels[3].set(xlabel="time [s]")
        figure.suptitle(f"From the {case}, one drive", fontsize=9, x=0.02, ha="left")
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def friction_figure(raced: Raced, cases: tuple[str, ...] = ("split mu", "mu jump")) -> Any:
    """Friction under each wheel over time: medians over seeds, quartiles as bands; the truth of the first seed."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 7.0), layout="constrained")
    step = round(EVERY / raced.study.dt)
    there = raced.found.design.axis("estimator").labels
    with style():
        panels = figure.subplots(4, len(cases), sharex=True, sharey=True, squeeze=False)
        for column, case in enumerate(cases):
            true = raced.drives.true_friction[raced.cases.index(case)][0][::step]
            for row, axes in enumerate(panels[:, column]):
                first = row == 0 and column == 0
                for who, colour in MUS.items():
                    if who not in there:
                        continue
                    values = raced.at("friction", who, case)[..., row]
                    low, mid, high = np.nanpercentile(values, [25, 50, 75], axis=0)
                    time = EVERY * np.arange(len(mid))
                    axes.plot(time, mid, color=colour, label=who if first else None)
                    axes.fill_between(time, low, high, color=colour, alpha=0.15, linewidth=0)
                own = EVERY * np.arange(len(true))
                axes.plot(own, true[:, row], color=COLOURS["truth"], linewidth=0.8, label="truth" if first else None)
                axes.set(yscale="log", ylim=(0.1, 2.0))
                axes.set_yticks(TICKS, labels=[f"{tick:g}" for tick in TICKS])
                axes.set_yticks([], minor=True)
                if column == 0:
                    axes.set(ylabel=f"mu, {WHEELS[row]}")
            panels[0, column].set(title=case)
            panels[3, column].set(xlabel="time [s]")
        figure.legend(loc="outside lower center", ncols=3)
    return figure
