"""The study's figures: the parameters over time, one drive with its fault, the information in steer and speed."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.federated_ckf.report import SHORT, Reproduction
from jaxveh.experiments.federated_ckf.road_figures import friction_figure, speeds_figure
from jaxveh.experiments.federated_ckf.settings import PARAMETERS
from jaxveh.experiments.federated_ckf.study import Raced, truth
from jaxveh.plots import COLOURS, kit, style

EVERY = 0.1
"""s between the rows that are kept."""

UNITS = {"friction": "-", "mass": "kg", "yaw_inertia": "kg m²", "front_axle_to_cg": "m"}

SHOWN = {
    "first guess": COLOURS["prior"],
    "three federated, shared sensors": kit.CYCLE[3],
    "three interleaved": kit.CYCLE[4],
    "joint": kit.CYCLE[0],
    "redesigned": kit.CYCLE[1],
}
"""The estimators of the figures and their colours."""


def figures(result: Reproduction) -> dict[str, Any]:
    """All figures by file stem."""
    return {
        "parameters": parameters_figure(result.raced),
        "drive": drive_figure(result.raced),
        "fault": fault_figure(result.raced),
        "line": line_figure(result),
        "speeds": speeds_figure(result.raced, _those(result.raced, SHOWN)),
        "friction": friction_figure(result.roads),
    }


def _those(raced: Raced, colours: dict[str, str]) -> dict[str, str]:
    """Those of these estimators that took part, with their colours."""
    return {name: colour for name, colour in colours.items() if name in raced.found.design.axis("estimator").labels}


def parameters_figure(raced: Raced, case: str = "printed start") -> Any:
    """The four parameters over time: medians over seeds, with quartiles as bands."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 5.0), layout="constrained")
    with style():
        panels = figure.subplots(2, 2, sharex=True)
        for i, (axes, name) in enumerate(zip(panels.flat, PARAMETERS, strict=True)):
            for who, colour in _those(raced, SHOWN).items():
                values = raced.at("parameters", who, case)[..., i]
                low, mid, high = np.nanpercentile(values, [25, 50, 75], axis=0)
                time = EVERY * np.arange(len(mid))
                dashes = (0, (4, 3)) if who == "redesigned" else "-"
                axes.plot(time, mid, color=colour, linestyle=dashes, label=who if i == 0 else None)
                axes.fill_between(time, low, high, color=colour, alpha=0.15, linewidth=0)
            true = truth(raced.study)[i]
            axes.axhline(true, color=COLOURS["truth"], linewidth=0.8, label="truth" if i == 0 else None)
            axes.set(ylabel=f"{SHORT[name]} [{UNITS[name]}]", ylim=(0.4 * true, 1.7 * true))
            if name == "friction":
                axes.set(ylim=(0.05, 3.0), yscale="log")
        for axes in panels[1]:
            axes.set(xlabel="time [s]")
        figure.suptitle(
            f"From the {case}: median and quartiles over {raced.found.seeds} seeds", fontsize=9, x=0.02, ha="left"
        )
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def drive_figure(raced: Raced, seed: int = 0) -> Any:
    """One drive: steer, speed, lateral acceleration, sideslip, and the errors of the sideslip from the printed start."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 6.6), layout="constrained")
    place = raced.cases.index("printed start")
    drive = type(raced.drives)(*(leaf[place, seed] for leaf in raced.drives))
    time = raced.study.dt * np.arange(len(drive.steer))
    step = round(EVERY / raced.study.dt)
    true = np.rad2deg(drive.true_sideslip)
    with style():
        panels = figure.subplots(5, 1, sharex=True, height_ratios=(1, 1, 1, 1, 2))
        panels[2].plot(time, drive.a_y, color=COLOURS["prior"], linewidth=0.5, label="measured")
        truths = (np.rad2deg(drive.steer[:, 0]), 3.6 * drive.true_v_x, None, true)
        for axes, values in zip(panels, truths, strict=False):
            if values is not None:
                axes.plot(time, values, color=COLOURS["truth"])
        labels = ("steer [°]", "speed [km/h]", "measured $a_y$\n[m/s²]", "sideslip [°]", "error of the\nsideslip [°]")
        for axes, label in zip(panels, labels, strict=True):
            axes.set(ylabel=label)
        for who, colour in _those(raced, SHOWN).items():
            error = np.rad2deg(raced.at("sideslip", who, "printed start")[seed]) - true[::step]
            dashes = (0, (4, 3)) if who == "redesigned" else "-"
            panels[4].plot(time[::step], error, color=colour, linestyle=dashes, label=who)
        panels[4].set(xlabel="time [s]")
        figure.legend(*panels[4].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


FAULTY = {
    "joint": kit.CYCLE[0],
    "joint, gated": kit.CYCLE[2],
    "redesigned": kit.CYCLE[1],
    "redesigned, isolating": kit.CYCLE[5],
}


def fault_figure(raced: Raced) -> Any:
    """The sideslip's error over time with the fault: median of its absolute value over seeds."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.4), layout="constrained")
    study, step = raced.study, round(EVERY / raced.study.dt)
    true = np.rad2deg(raced.drives.true_sideslip[raced.cases.index("fault")][:, ::step])
    with style():
        axes = figure.subplots()
        axes.axvspan(study.fault_at, study.fault_at + study.fault_time, color=kit.SHADE, zorder=0, label="fault")
        for who, colour in _those(raced, FAULTY).items():
            error = np.abs(np.rad2deg(raced.at("sideslip", who, "fault")) - true)
            dashes = (0, (4, 3)) if who.startswith("redesigned") else "-"
            median = np.maximum(np.nanmedian(error, axis=0), 1e-4)
            axes.plot(EVERY * np.arange(error.shape[1]), median, color=colour, linestyle=dashes, label=who)
        axes.set(
            xlabel="time [s]", ylabel="error of the sideslip [°]", yscale="log",
            xlim=(study.settled, study.duration), ylim=(1e-3, 1.0),
            title=f"Yaw rate off by {study.bias:g} rad/s: median over {raced.found.seeds} seeds",
        )  # fmt: skip
        figure.legend(loc="outside lower center", ncols=5)
    return figure


def line_figure(result: Reproduction) -> Any:
    """Bounds of friction and mass over the steer amplitude, for several variations of the speed, and the joint filter's
    errors."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.8), layout="constrained")
    bound = lambda who, name, j: 100.0 * np.array([row[j].bounds[name] for row in result.seen[who]])
    with style():
        left, right = figure.subplots(1, 2)
        for j, speed in enumerate(result.spreads):
            colour, label = kit.CYCLE[j], f"speed varied by {speed:g} m/s"
            left.plot(result.steers, bound("known", "friction", j), color=colour, label=label)
            right.plot(result.steers, bound("known", "mass", j), color=colour, linestyle=":")
            right.plot(result.steers, bound("unknown", "mass", j), color=colour)
            for axes, name in ((left, "friction"), (right, "mass")):
                found = 100.0 * np.median(result.over[f"{name}_error"][:, j], axis=-1)
                axes.plot(result.steers, found, color=colour, linestyle="none", marker="o", markersize=4)
        left.set(ylabel="mu [%]", title="Friction: no bound where no wheel slides")
        right.set(ylabel="m [%]", title="Mass: rolling resistance known or not")
        for axes in (left, right):
            axes.set(xlabel="steer amplitude [°]", yscale="log")
            axes.margins(x=0.04)
        grey = dict(color="#444444")
        left.plot([], [], **grey, label="bound (right: resistance unknown)")
        left.plot([], [], **grey, linestyle=":", label="resistance known, as in the filters")
        left.plot([], [], **grey, linestyle="none", marker="o", markersize=4, label="joint filter, median error")
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
