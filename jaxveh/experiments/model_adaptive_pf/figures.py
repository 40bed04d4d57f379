"""The study's figures: one drive's sideslip, the errors of all estimators, where the gain is, and the printed tyre."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxveh.experiments.model_adaptive_pf.contestants import CUBATURE, EVERY, PLAIN, REDESIGNED, ROBUST, TOLD
from jaxveh.experiments.model_adaptive_pf.drives import Drive, fiala, numbers_of, times, true_car
from jaxveh.experiments.model_adaptive_pf.models import SIX
from jaxveh.experiments.model_adaptive_pf.printed import printed_tyre
from jaxveh.experiments.model_adaptive_pf.report import Reproduction, against
from jaxveh.experiments.model_adaptive_pf.settings import CASES, LIMIT, Study
from jaxveh.experiments.model_adaptive_pf.study import Raced
from jaxveh.plots import COLOURS, kit, style
from jaxveh.tyres import Contact

SHOWN = {
    CUBATURE: "#e0c8b8",
    "open loop": "#7f7f7f",
    "AAR": kit.CYCLE[3],
    PLAIN: kit.CYCLE[0],
    REDESIGNED: kit.CYCLE[2],
}
"""The estimators of the drive's figure, and their colours."""


def figures(result: Reproduction) -> dict[str, Any]:
    """All figures by file stem."""
    raced = result.raced
    return {
        "measured": measured_figure(raced),
        "sideslip": sideslip_figure(raced),
        "six_states": six_figure(raced, "constant"),
        "six_states_in_noise": six_figure(raced, "both"),
        "ablation": ablation_figure(raced),
        "gain": gain_figure(raced),
        "process_noise": pressed_figure(result.pressed),
        "tyre": tyre_figure(raced.study),
    }


def _drive(raced: Raced, case: str, seed: int) -> Drive:
    i = list(raced.cases).index(case)
    return Drive(*(np.asarray(leaf)[i, seed] for leaf in raced.drives))


def measured_figure(raced: Raced, case: str = "both", seed: int = 0, figure: Any = None) -> Any:
    """The sensors' measurements on one drive, and the truth."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.6), layout="constrained") if figure is None else figure
    drive, t = _drive(raced, case, seed), np.asarray(times(raced.study))
    channels = {"v_x": ("v_x [m/s]", 1.0), "a_y": ("a_y [m/s²]", 1.0), "yaw_rate": ("yaw rate [°/s]", 180.0 / np.pi)}
    with style():
        panels = figure.subplots(len(channels), 1, sharex=True)
        for axes, (name, (label, unit)) in zip(panels, channels.items(), strict=True):
            truth, said = unit * getattr(drive, f"true_{name}"), unit * getattr(drive, name)
            std = unit * raced.study.stds[name]
            band = std * drive.level
            axes.fill_between(t, truth - band, truth + band, color="#e8dfc2", linewidth=0, label="noise, one std")
            axes.plot(t, said, ".", color=kit.CYCLE[0], markersize=1.5, label="measured")
            axes.plot(t, truth, color=COLOURS["truth"], label="truth")
            # Outliers may leave the figure.
            reach = np.max(np.abs(truth - truth.mean())) + 20.0 * std
            axes.set(ylabel=label, ylim=(truth.mean() - reach, truth.mean() + reach))
        panels[-1].set(xlabel="time [s]")
        panels[0].set_title(f"One drive of '{case}': noise that rises, and 3 % outliers, most outside the figure")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def sideslip_figure(raced: Raced, case: str = "both", seed: int = 0, figure: Any = None) -> Any:
    """Sideslip of one drive as estimated, and the errors below, as in the paper's figure 4."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.6), layout="constrained") if figure is None else figure
    drive, t = _drive(raced, case, seed), np.asarray(times(raced.study))
    with style():
        above, below = figure.subplots(2, 1, sharex=True)
        truth = np.rad2deg(drive.true_sideslip)
        above.plot(t, truth, color=COLOURS["truth"], label="truth", zorder=3)
        there = raced.found.design.axis("estimator").labels
        for name, colour in SHOWN.items():
            if name not in there:
                continue
            found = np.rad2deg(raced.of("course", name, case)[seed])
            above.plot(t, found, color=colour, label=name)
            below.plot(t, found - truth, color=colour)
        above.set(ylabel="sideslip [°]", title=f"One drive of '{case}'")
        # The cubature filter's errors after outliers may leave the figure.
        above.set(ylim=(1.8 * truth.min(), 1.8 * truth.max()))
        below.set(xlabel="time [s]", ylabel="error [°]", ylim=(-1.0, 1.0))
        figure.legend(loc="outside upper left", ncols=3)
    return figure


def six_figure(raced: Raced, case: str = "both", seed: int = 0, figure: Any = None) -> Any:
    """The six states of the paper's figure 4 on one drive, by its three methods."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 6.0), layout="constrained") if figure is None else figure
    drive, t = _drive(raced, case, seed), np.asarray(times(raced.study))
    degrees = 180.0 / np.pi
    labels = {
        "v_x": ("v_x [m/s]", 1.0), "v_y": ("v_y [m/s]", 1.0), "a_x": ("a_x [m/s²]", 1.0), "a_y": ("a_y [m/s²]", 1.0),
        "yaw_rate": ("yaw rate [°/s]", degrees), "sideslip": ("sideslip [°]", degrees),
    }  # fmt: skip
    colours = {"strong tracking": "#e0c8b8", PLAIN: kit.CYCLE[0], "AAR": kit.CYCLE[3]}
    with style():
        every = figure.subplots(3, 2, sharex=True)
        for axes, (name, (label, unit)) in zip(every.ravel(), labels.items(), strict=True):
            truth = unit * getattr(drive, f"true_{name}")
            for one, colour in colours.items():
                course = unit * raced.of("six", one, case)[seed, SIX.index(name)]
                axes.plot(t[::EVERY], course, color=colour, label=one)
            axes.plot(t, truth, color=COLOURS["truth"], label="truth", linestyle="--")
            # Errors after outliers may leave the figure, for a filter without a model of them.
            reach = 1.5 * np.max(np.abs(truth - truth.mean()))
            axes.set(ylabel=label, ylim=(truth.mean() - reach, truth.mean() + reach))
        for axes in every[-1]:
            axes.set(xlabel="time [s]")
        every[0, 0].set_title(f"One drive of '{case}'")
        figure.align_ylabels()
        figure.legend(*every[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


def ablation_figure(raced: Raced, figure: Any = None) -> Any:
    """Sideslip RMSE of every estimator, median and quartiles, with each kind of noise."""
    names = raced.found.design.axis("estimator").labels
    figure = (
        kit.Figure(figsize=(kit.PAGE_WIDTH, 0.32 * len(names) + 1.2), layout="constrained")
        if figure is None
        else figure
    )
    with style():
        axes = figure.subplots()
        for i, (case, colour) in enumerate(zip(CASES, kit.CYCLE, strict=False)):
            values = np.stack([raced.of("sideslip", name, case) for name in names])
            values = np.where(np.isfinite(values), values, 1e9)
            low, mid, high = np.percentile(values, [25, 50, 75], axis=1)
            y = np.arange(len(names)) + 0.16 * (i - 1.5)
            axes.errorbar(mid, y, xerr=(mid - low, high - mid), fmt="o", markersize=3, color=colour, label=case)
        axes.set_xscale("log")
        axes.set_yticks(np.arange(len(names)), names)
        axes.invert_yaxis()
        best = min(float(np.min(raced.of("sideslip", name, case))) for name in names for case in CASES)
        axes.set(
            xlabel="sideslip RMSE [°], median and quartiles over seeds", xlim=(0.8 * best, 2.5),
            title="Errors of all estimators; lost runs lie outside the figure",
        )  # fmt: skip
        figure.legend(loc="outside upper left", ncols=4)
    return figure


def gain_figure(raced: Raced, figure: Any = None) -> Any:
    """Paired ratios to the plain particle filter in every case, with bootstrap intervals."""
    shown = (REDESIGNED, "PF, wavelet", "PF, mixture", ROBUST, TOLD, "PF, no relaxation", "open loop")
    cases = {**CASES, **LIMIT}
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 4.0), layout="constrained") if figure is None else figure
    with style():
        axes = figure.subplots()
        for i, name in enumerate(shown):
            found = [against(raced, case, name).ratio for case in cases]
            mid = np.array([float(one.value) for one in found])
            bars = mid - np.array([float(one.low) for one in found]), np.array([float(one.high) for one in found]) - mid
            x = np.arange(len(cases)) + 0.11 * (i - 3.0)
            axes.errorbar(x, mid, bars, fmt="o", markersize=3, capsize=2, color=(*kit.CYCLE, "#7f7f7f")[i], label=name)
        axes.axhline(1.0, color="#444444", linewidth=0.6)
        axes.axvspan(len(CASES) - 0.5, len(cases) - 0.5, color="#f7f1df", zorder=0)
        labels = [name.replace(" % ", " %\n") for name in cases]
        axes.set_xticks(np.arange(len(cases)), labels, fontsize=7)
        axes.set_yscale("log")
        axes.set_yticks([0.5, 0.7, 1.0, 1.5, 2.0, 3.0], ["0.5", "0.7", "1", "1.5", "2", "3"])
        axes.minorticks_off()
        axes.set(ylabel=f"sideslip RMSE over {PLAIN}'s [-]", title="Median and 95 % interval; shaded: near the limit")
        figure.legend(loc="outside upper left", ncols=3)
    return figure


def pressed_figure(raced: Raced, figure: Any = None) -> Any:
    """Sideslip RMSE over the process noise of the filters' models: medians and quartiles."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.4), layout="constrained") if figure is None else figure
    shares = [case.process for case in raced.cases.values()]
    with style():
        axes = figure.subplots()
        for i, name in enumerate(raced.found.design.axis("estimator").labels):
            values = np.stack([raced.of("sideslip", name, case) for case in raced.cases])
            low, mid, high = np.percentile(values, [25, 50, 75], axis=1)
            colour = ("#7f7f7f", *kit.CYCLE)[i]
            axes.plot(shares, mid, marker="o", markersize=3, color=colour, label=name)
            axes.fill_between(shares, low, high, color=colour, alpha=0.12, linewidth=0)
        axes.set(
            xscale="log", yscale="log", xlabel="process noise over the one that clean sensors chose [-]",
            ylabel="sideslip RMSE [°]", title="'both': median and quartiles over seeds",
        )  # fmt: skip
        axes.set_xticks(shares, [f"{share:g}" for share in shares])
        axes.set_yticks([0.07, 0.1, 0.15, 0.2, 0.3], ["0.07", "0.1", "0.15", "0.2", "0.3"])
        axes.minorticks_off()
        figure.legend(loc="outside upper left", ncols=3)
    return figure


def tyre_figure(study: Study, figure: Any = None) -> Any:
    """The printed Fiala tyre, the corrected one and the true one on a front wheel: lateral force and aligning moment."""
    figure = kit.Figure(figsize=(kit.PAGE_WIDTH, 3.2), layout="constrained") if figure is None else figure
    load = numbers_of(study).wheel_loads()[0]
    alpha = np.radians(np.linspace(0.0, 16.0, 641))
    contact = Contact(
        slip_angle=jnp.asarray(alpha), slip_ratio=jnp.zeros(len(alpha)), load=jnp.asarray(load), speed=jnp.asarray(study.speed)
    )  # fmt: skip
    laws = {
        "truth (Magic Formula)": (true_car(study).front.tyre, COLOURS["truth"], "-"),
        "Fiala, errata corrected": (fiala(study), kit.CYCLE[2], "-"),
        "Fiala as printed": (printed_tyre(study), kit.CYCLE[1], "--"),
    }
    with style():
        left, right = figure.subplots(1, 2)
        for name, (law, colour, line) in laws.items():
            found = law.forces(contact)
            left.plot(np.degrees(alpha), np.asarray(found.F_y), color=colour, linestyle=line, label=name)
            right.plot(np.degrees(alpha), np.asarray(found.M_z), color=colour, linestyle=line)
        left.set(xlabel="slip angle [°]", ylabel="lateral force [N]")
        right.set(xlabel="slip angle [°]", ylabel="aligning moment [N m]")
        figure.legend(loc="outside upper left", ncols=3)
    return figure
