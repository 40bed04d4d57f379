"""The study's figures: the drive, the mass over time, the grade of one drive and its error, the effect of the pedals."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.mass_grade_aukf.drives import model_car
from jaxveh.experiments.mass_grade_aukf.report import Reproduction
from jaxveh.experiments.mass_grade_aukf.settings import GATE
from jaxveh.experiments.mass_grade_aukf.study import Raced
from jaxveh.plots import COLOURS, kit, style

SHOWN = ("first guess", "UKF", "AUKF", "grade rate", "accelerometer")
"""The estimators of the figures."""

SPELLS = ("#7f7f7f", kit.CYCLE[0], kit.CYCLE[3], kit.CYCLE[2], kit.CYCLE[1])


def figures(result: Reproduction) -> dict[str, Any]:
    """Every figure by the name of its file."""
    drawn = {}
    for raced in (result.truck, result.car):
        drawn[f"{raced.study.name}_drive"] = drive_figure(raced)
        drawn[f"{raced.study.name}_mass"] = mass_figure(raced)
        drawn[f"{raced.study.name}_grade"] = grade_figure(raced)
    return drawn | {"pedals": activity_figure(result.gentle, result.truck)}


def _names_and_colours(raced: Raced) -> list[tuple[str, str]]:
    """Names and colours of the estimators of the figures that took part in this race."""
    there = raced.found.design.axis("estimator").labels
    return [(name, colour) for name, colour in zip(SHOWN, SPELLS, strict=True) if name in there]


def drive_figure(raced: Raced, seed: int = 0, guess: int = 0, figure: Any = None) -> Any:
    """One drive, as in figures 3, 4 and 8 of the paper for the truck and 12, 13 and 15 to 17 for the car: speed, force at
    the wheels, acceleration; with brake touches also the brake's signal and whether a pausing UKF goes on."""
    study = raced.study
    panels = 5 if study.touches else 3
    figure = (
        kit.Figure(figsize=(kit.PAGE_WIDTH, 1.3 * panels + 0.4), layout="constrained") if figure is None else figure
    )
    speed, torque, braking = (x[-1, seed] for x in (raced.drives.true_v_x, raced.drives.torque, raced.drives.braking))
    time = study.dt * np.arange(len(speed))
    rate = np.gradient(speed, study.dt)
    drawn = [
        ("speed [km/h]", 3.6 * speed),
        ("force at the\nwheels [kN]", torque / float(model_car(study).wheel_radius) / 1000.0),
        ("acceleration\n[m/s²]", rate),
    ]
    if study.touches:
        moves = raced.found.at("moves", estimator="UKF", pedals=raced.pedals[-1])[guess, seed]
        drawn += [("brake touched\n[0 or 1]", braking), ("UKF goes on\n[0 or 1]", moves)]
    with style():
        axes = figure.subplots(panels, 1, sharex=True)
        for one, (label, values) in zip(axes, drawn, strict=True):
            one.plot(time, values, color=COLOURS["truth"], drawstyle="steps-post" if label[-3:] == "1]" else "default")
            one.set(ylabel=label)
        for one in axes[3:]:
            one.set(ylim=(-0.15, 1.15), yticks=(0, 1))
        for gate in (-GATE, GATE):
            axes[2].axhline(gate, color="#444444", linewidth=0.6, linestyle=":")
        axes[0].set(title=f"{study.name}, one drive; dotted: {GATE:g} m/s², below which reference 8 does not estimate")
        axes[-1].set(xlabel="time [s]")
        figure.align_ylabels()
    return figure


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
    """True and estimated grade of one drive, as in figures 9 and 18 of the paper, the error as in 10 and 19, and the speed
    above."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 6.0), layout="constrained") if figure is None else figure
    every = round(1.0 / raced.study.dt)
    with style():
        above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(1, 2, 2))
        speed, truth = (x[-1, seed, ::every] for x in (raced.drives.true_v_x, raced.drives.true_grade))
        time = np.arange(len(speed))
        above.plot(time, 3.6 * speed, color=COLOURS["truth"])
        above.set(ylabel="speed [km/h]", title=f"{raced.study.name}, one drive from {raced.study.guesses[guess]:g} kg")
        middle.plot(time, np.rad2deg(truth), color=COLOURS["truth"], label="truth")
        for name, colour in [pair for pair in _names_and_colours(raced) if pair[0] in SHOWN[1:4]]:
            grade = raced.found.at("grade", estimator=name, pedals=raced.pedals[-1])[guess, seed]
            middle.plot(time, np.rad2deg(grade), color=colour, label=name)
            below.plot(time, np.rad2deg(grade - truth), color=colour)
        middle.set(ylabel="grade [°]")
        below.axhline(0.0, color=COLOURS["truth"], linewidth=0.6)
        below.set(xlabel="time [s]", ylabel="error of the\ngrade [°]", ylim=(-1.0, 1.0))
        figure.align_ylabels()
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
            title=f"{raced[0].study.name}: effect of pedal activity; median and quartiles, dotted: 3 %",
        )  # fmt: skip
        figure.legend(loc="outside upper left", ncols=5)
    return figure
