"""Figures over time: parameters, the lane change and the step steer with estimated tyres."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.tyre_apf.reproduction import Reproduction
from jaxveh.experiments.tyre_apf.settings import STEP_OUTPUTS, STEPS
from jaxveh.experiments.tyre_apf.study import FIELDS
from jaxveh.experiments.tyre_apf.tracks import Tracks
from jaxveh.plots import COLOURS, kit, style

FILTERS = {"PF": kit.CYCLE[0], "APF": kit.CYCLE[3], "UKF": kit.CYCLE[2]}
"""The filters of the tracks and their colours."""

TYRES = {"prior": "#7f7f7f", "PF": kit.CYCLE[0], "APF": kit.CYCLE[3], "MAP": kit.CYCLE[2]}
"""The estimators whose tyres are used in the lane change and the step steer, with their colours."""

UNITS = {"B": "1/rad", "C": "-", "D": "kN", "E": "-"}
"""Units in which parameters are shown."""

SHOWN = {
    "yaw_rate": ("yaw rate [°/s]", np.rad2deg(1.0)),
    "yaw": ("yaw [°]", np.rad2deg(1.0)),
    "v_y": ("v_y [m/s]", 1.0),
    "F_yf": ("front F_y [kN]", 1e-3),
    "F_yr": ("rear F_y [kN]", 1e-3),
}
"""Labels and scales."""


def tracks_figure(tracks: Tracks, truth: np.ndarray, seed: int = 0, figure: Any = None) -> Any:
    """The eight parameters of seed number `seed` over time, as in figures 6 to 13 of the paper: the filters' means, the
    prior's mean, the `truth` (8,)."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 7.2), layout="constrained") if figure is None else figure
    with style():
        every = figure.subplots(4, 2, sharex=True)
        for i, field in enumerate(FIELDS):
            axle, name = field.split("_")
            axes, scale = every[i % 4, i // 4], 1e-3 if name == "D" else 1.0
            axes.axhline(scale * truth[i], color=COLOURS["truth"], label="truth")
            axes.plot(tracks.time, scale * tracks.mean["prior"][seed, i], color="#7f7f7f", linestyle=":", label="prior")
            for one, colour in FILTERS.items():
                axes.plot(tracks.time, scale * tracks.mean[one][seed, i], color=colour, label=one)
            axes.set(ylabel=f"{axle} {name} [{UNITS[name]}]")
        for axes in every[-1]:
            axes.set(xlabel="time [s]")
        figure.align_ylabels()
        figure.legend(*every[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=5)
    return figure


def lane_change_figure(result: Reproduction, seed: int = 0, figure: Any = None) -> Any:
    """The lane change of seed number `seed` without measurements, with the estimated tyres, as in figures 14 to 16."""
    drive = result.outcome.drive
    time = np.asarray(drive.time)[seed]
    courses = {"truth": {name: np.asarray(drive[f"true.{name}"])[seed] for name in ("yaw_rate", "yaw", "v_y")}}
    courses |= {one: {name: np.asarray(v)[seed] for name, v in result.open_loop[one].items()} for one in TYRES}
    return _courses(time, courses, ("yaw_rate", "yaw", "v_y"), "lane change", figure)


def step_figure(result: Reproduction, seed: int = 0, figure: Any = None) -> Any:
    """The step steer of 5 degrees with the tyres of seed number `seed`, as in figures 19 to 23."""
    names = ("yaw_rate", "yaw", "v_y", "F_yf", "F_yr")
    courses = {
        one: dict(zip(STEP_OUTPUTS, np.asarray(result.first_step[one])[seed], strict=True)) for one in ("truth", *TYRES)
    }
    time = np.arange(len(courses["truth"]["yaw"])) / result.study.rate
    return _courses(time, courses, names, f"step steer of {STEPS[0]} degrees", figure)


def _courses(time: np.ndarray, courses: dict, names: tuple[str, ...], what: str, figure: Any) -> Any:
    size = (kit.PAGE_WIDTH, 1.4 * len(names) + 0.5)
    figure = kit.Figure(figsize=size, layout="constrained") if figure is None else figure
    with style():
        every = figure.subplots(len(names), 1, sharex=True)
        for axes, name in zip(every, names, strict=True):
            label, scale = SHOWN[name]
            for one, course in courses.items():
                dashed = {"linestyle": "--"} if one == "truth" else {}
                colour = COLOURS["truth"] if one == "truth" else TYRES[one]
                # The truth on top of all, so that it is visible where they agree.
                order = 3 if one == "truth" else 2
                axes.plot(time, scale * course[name], color=colour, label=one, zorder=order, **dashed)
            axes.set(ylabel=label)
        every[0].set(title=f"{what}, no measurements: the car with each estimator's tyres")
        every[-1].set(xlabel="time [s]")
        figure.align_ylabels()
        figure.legend(*every[0].get_legend_handles_labels(), loc="outside upper left", ncols=5)
    return figure
