"""The study's pictures: the mass over time, the grade of one drive, what pedals are worth."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.mass_grade_aukf.report import Reproduction
from jaxveh.experiments.mass_grade_aukf.study import Raced
from jaxveh.plots import COLOURS, kit, style

SHOWN = ("first guess", "UKF", "AUKF", "grade rate", "accelerometer")
"""The estimators of the figures."""

SPELLS = ("#7f7f7f", kit.CYCLE[0], kit.CYCLE[3], kit.CYCLE[2], kit.CYCLE[1])


def figures(result: Reproduction) -> dict[str, Any]:
    """Every figure by the name of its file."""
    drawn = {}
    for raced in (result.truck, result.car):
        drawn[f"{raced.study.name}_mass"] = mass_figure(raced)
        drawn[f"{raced.study.name}_grade"] = grade_figure(raced)
    return drawn | {"pedals": activity_figure(result.gentle, result.truck)}


def _names_and_colours(raced: Raced) -> list[tuple[str, str]]:
    """Names and colours of the estimators of the figures that were in this race."""
    there = raced.found.design.axis("estimator").labels
    return [(name, colour) for name, colour in zip(SHOWN, SPELLS, strict=True) if name in there]


def mass_figure(raced: Raced, guess: int = 0, figure: Any = None) -> Any:
    """The mass's error over time from one first guess: medians over seeds, and quartiles as bands."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.6), layout="constrained") if figure is None else figure
    with style():
        axes = figure.subplots()
        for name, colour in _names_and_colours(raced):
            mass = raced.found.at("mass", estimator=name, pedals=raced.pedals[-1])[guess]
            error = 100.0 * (mass / raced.study.mass - 1.0)
            low, mid, high = np.nanpercentile(error, [25, 50, 75], axis=0)
            time = np.arange(len(mid))
            axes.plot(time, mid, color=colour, label=name)
            axes.fill_between(time, low, high, color=colour, alpha=0.15, linewidth=0)
        axes.axhspan(-3.0, 3.0, color="#f7f1df", zorder=0)
        first = 100.0 * (raced.study.guesses[guess] / raced.study.mass - 1.0)
        axes.set(
            xlabel="time [s]", ylabel="error of the mass [%]", ylim=(min(-40.0, first - 5.0), 20.0),
            title=f"{raced.study.name} from {raced.study.guesses[guess]:g} kg: median and quartiles over seeds; shaded: 3 %",
        )  # fmt: skip
        figure.legend(loc="outside upper left", ncols=5)
    return figure


def grade_figure(raced: Raced, seed: int = 0, guess: int = 0, figure: Any = None) -> Any:
    """True and estimated grade of one drive, and the speed above it."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.4), layout="constrained") if figure is None else figure
    every = round(1.0 / raced.study.dt)
    with style():
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
        speed = raced.drives.true_v_x[-1, seed, ::every]
        time = np.arange(len(speed))
        above.plot(time, 3.6 * speed, color=COLOURS["truth"])
        above.set(ylabel="speed [km/h]", title=f"{raced.study.name}, one drive from {raced.study.guesses[guess]:g} kg")
        below.plot(time, np.rad2deg(raced.drives.true_grade[-1, seed, ::every]), color=COLOURS["truth"], label="truth")
        for name, colour in [pair for pair in _names_and_colours(raced) if pair[0] in SHOWN[1:4]]:
            grade = raced.found.at("grade", estimator=name, pedals=raced.pedals[-1])[guess, seed]
            below.plot(time, np.rad2deg(grade), color=colour, label=name)
        below.set(xlabel="time [s]", ylabel="grade [°]")
        figure.legend(loc="outside upper left", ncols=4)
    return figure


def activity_figure(*raced: Raced, figure: Any = None) -> Any:
    """Final mass error against pedal activity, of races of one vehicle: medians and quartiles over seeds and guesses."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.4), layout="constrained") if figure is None else figure
    pedals = [p for one in raced for p in one.pedals]
    with style():
        axes = figure.subplots()
        for i, (name, colour) in enumerate(_names_and_colours(raced[0])):
            errors = [100.0 * one.found.at("mass_error", estimator=name, pedals=p) for one in raced for p in one.pedals]
            low, mid, high = np.transpose([np.nanpercentile(error, [25, 50, 75]) for error in errors])
            x = np.arange(len(pedals)) + 0.06 * (i - 2)
            axes.errorbar(
                x, mid, (mid - low, high - mid), color=colour, marker="o", markersize=4, capsize=2, label=name
            )
        axes.set_yscale("log")
        axes.set_xticks(np.arange(len(pedals)), [f"{p:g}" for p in pedals])
        axes.axhline(3.0, color="#444444", linewidth=0.6, linestyle=":")
        axes.set(
            xlabel="pedal activity [m/s²]", ylabel="final error of the mass [%]",
            title=f"{raced[0].study.name}: what restless pedals are worth; median and quartiles, dotted: 3 %",
        )  # fmt: skip
        figure.legend(loc="outside upper left", ncols=5)
    return figure
