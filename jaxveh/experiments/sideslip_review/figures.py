"""The study's figures: the review's table as numbers, errors by scenario, one drive at the limit, the real log."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh.experiments.sideslip_review.chapters import chapter_figures
from jaxveh.experiments.sideslip_review.recorded import BEST, READY, Logged
from jaxveh.experiments.sideslip_review.report import Reproduction
from jaxveh.experiments.sideslip_review.study import EVERY, Raced
from jaxveh.experiments.sideslip_review.verdicts import CONTRADICTS, SUPPORTS, verdicts
from jaxveh.plots import COLOURS, kit, style

SHOWN = ("open loop", "integration", "linear Kalman", "EKF", "pseudo-integration", "handling")
"""The methods of the figures."""

LINES = (COLOURS["prior"], kit.CYCLE[1], kit.CYCLE[5], kit.CYCLE[0], kit.CYCLE[2], kit.CYCLE[3])

VERDICT_COLOURS = {SUPPORTS: kit.CYCLE[2], CONTRADICTS: kit.CYCLE[1]}


def figures(result: Reproduction) -> dict[str, Any]:
    """All figures by the stems of their files."""
    found = {
        "marks": marks_figure(result.raced),
        "errors": errors_figure(result.raced),
        "limit": drive_figure(result.raced, "limit"),
        "sensor_bias": drive_figure(result.raced, "sensor bias"),
    }
    if result.chapters is not None:
        found |= chapter_figures(result.chapters)
    return found if result.logged is None else found | {"log": log_figure(result.logged)}


def marks_figure(raced: Raced) -> Any:
    """Every cell of the review's table: its number over the largest good one, with its interval."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.0), layout="constrained")
    cells = verdicts(raced)
    with style():
        axes = figure.subplots()
        for place, cell in enumerate(reversed(cells)):
            low, mid, high = (float(v) / cell.limit for v in (cell.found.low, cell.found.value, cell.found.high))
            colour = VERDICT_COLOURS.get(cell.verdict, COLOURS["prior"])
            axes.errorbar(
                mid, place, xerr=[[mid - low], [high - mid]], color=colour, marker="o" if cell.mark else "x",
                markersize=6, capsize=2, linestyle="none", markerfacecolor="none",
            )  # fmt: skip
        axes.axvline(1.0, color="#444444", linewidth=0.6, linestyle=":")
        axes.set_xscale("log")
        axes.set_yticks(range(len(cells)), [f"{cell.row}: {cell.method}" for cell in reversed(cells)])
        for name, colour in {**VERDICT_COLOURS, "cannot tell": COLOURS["prior"]}.items():
            axes.plot([], [], color=colour, label=f"the number {name}" if name in VERDICT_COLOURS else name)
        axes.set(xlabel="number over the largest good one [-]", title="The review's circles and crosses, as numbers")
        figure.legend(loc="outside upper left", ncols=3)
    return figure


def errors_figure(raced: Raced) -> Any:
    """Sideslip RMSE of the methods by scenario: medians and quartiles over seeds."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.6), layout="constrained")
    with style():
        panels = figure.subplots(2, 4, sharey=True, sharex=True).ravel()
        names = list(raced.found)
        for axes, scenario in zip(panels, (*raced.scenarios, "long"), strict=False):
            metric, where = ("late", "normal") if scenario == "long" else ("early", scenario)
            metric = "late" if scenario == "friction" else metric
            values = np.array([raced.at(metric, name, where) for name in names])
            low, mid, high = np.nanpercentile(values, [25, 50, 75], axis=1)
            places = np.arange(len(names))[::-1]
            colours = [LINES[SHOWN.index(name)] if name in SHOWN else "#444444" for name in names]
            for place, a, b, c, colour in zip(places, low, mid, high, colours, strict=True):
                axes.plot((a, c), (place, place), color=colour)
                axes.plot(b, place, marker="o", markersize=3.5, color=colour)
            axes.set_xscale("log")
            axes.set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
            axes.set(title=f"{scenario}, the end" if metric == "late" else scenario)
            axes.set_yticks(places, names, fontsize=7)
        for axes in panels[4:]:
            axes.set_xlabel("sideslip RMSE [°]")
        for axes in panels[len(raced.scenarios) + 1 :]:
            axes.set_visible(False)
    return figure


def drive_figure(raced: Raced, scenario: str, seed: int = 0) -> Any:
    """One drive: true and estimated sideslip, and the errors below."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.4), layout="constrained")
    place = raced.scenarios.index(scenario)
    true = np.rad2deg(raced.drives.sideslip[place, seed, ::EVERY])
    time = raced.drives.time[place, seed, ::EVERY]
    rows = time <= raced.study.span
    with style():
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(time[rows], true[rows], color=COLOURS["truth"], label="truth")
        for name, colour in zip(SHOWN, LINES, strict=True):
            if name not in raced.found:
                continue
            course = np.rad2deg(raced.at("course", name, scenario)[seed])
            above.plot(time[rows], course[rows], color=colour, label=name)
            below.plot(time[rows], (course - true)[rows], color=colour)
        # Methods that drift away leave the figure, so that the others can be distinguished.
        most = 2.0 * np.abs(true[rows]).max()
        above.set(ylabel="sideslip [°]", ylim=(-most, most), title=f"One drive: {scenario}")
        below.set(xlabel="time [s]", ylabel="error [°]", ylim=(-most, most))
        figure.legend(loc="outside upper left", ncols=4)
    return figure


def log_figure(logged: Logged) -> Any:
    """The real log: errors of every method, and a stretch of the courses."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 5.6), layout="constrained")
    order = sorted(logged.rmse, key=lambda name: -logged.rmse[name])
    with style():
        above, below = figure.subplots(2, 1, height_ratios=(3, 2))
        colours = [kit.CYCLE[1] if name in READY else kit.CYCLE[0] for name in order]
        above.barh(range(len(order)), [logged.rmse[name] for name in order], color=colours, height=0.6)
        above.set_yticks(range(len(order)), order, fontsize=7)
        above.axvline(BEST, color="#444444", linewidth=0.6, linestyle=":")
        above.set_xscale("log")
        above.set(xlabel="sideslip RMSE [°]", title="Real log, second half; dotted: the library's best so far")
        time = logged.time - logged.time[0]
        rows = (time > 30.0) & (time < 60.0)
        below.plot(time[rows], np.rad2deg(logged.courses["true"][rows]), color=COLOURS["truth"], label="measured")
        for name, colour in zip(
            ("EKF", READY[1], logged.best), (kit.CYCLE[0], kit.CYCLE[1], kit.CYCLE[2]), strict=True
        ):
            below.plot(time[rows], np.rad2deg(logged.courses[name][rows]), color=colour, label=name)
        below.set(xlabel="time in the second half [s]", ylabel="sideslip [°]")
        figure.legend(*below.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
