"""Figures of a sweep: lines over numbers, maps over pairs of numbers, violins, ranks, and errors over samples."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from jaxveh import plots
from jaxveh.studies.summary import at_front, baseline_of, errors_of, label, plain_values, quartiles, ranks
from jaxveh.studies.words import shown_on_figure, words_for
from jaxveh.sweeps import Axis, Swept

MOST_PANELS = 6
MOST_LINES = 6
COLUMNS = 3
MARKS = ("o-", "s--", "D:")
"""Markers and line styles that keep overlapping lines visible."""
BINS = 10
"""Number of bins of the samples along each of their numbers."""

SPREAD = 30.0
"""Ratio of the 95th to the 5th percentile from which on errors are drawn on a logarithmic axis."""


def figures(found: Swept, values: Iterable[str] = ()) -> Iterator[tuple[str, Any]]:
    """Name and figure of everything that can be drawn of these values (default: the errors, or all values if there are none)."""
    names = list(values) or errors_of(found, plain_values(found)) or plain_values(found)
    for name in plain_values(found, names):
        yield from _of_value(found, name)


def _of_value(found: Swept, name: str) -> Iterator[tuple[str, Any]]:
    numbers = [axis for axis in found.design.numbers if axis.columns is None and len(axis.labels) > 1]
    choices = [axis for axis in found.design.choices if len(axis.labels) > 1]
    by = choices[0] if choices and len(choices[0].labels) <= MOST_LINES else None
    stem = name.replace(".", "_")
    for axis in numbers:
        yield f"{stem}_over_{axis.name}", lines(found, name, axis, by)
    for x, y in itertools.combinations(numbers, 2):
        yield f"{stem}_map_{x.name}_{y.name}", heat_map(found, name, x, y, by)
    for axis in choices:
        yield f"{stem}_by_{axis.name}", violins(found, name, axis)
        if errors_of(found, [name]):
            yield f"{stem}_ranks_{axis.name}", rank_bars(found, name, axis)
    for axis in found.design.numbers:
        if axis.columns is not None:
            yield f"{stem}_over_{axis.name}", over_samples(found, name, axis, by)


def lines(found: Swept, name: str, axis: Axis, by: Axis | None = None) -> Any:
    """A value over an axis of numbers: median and quartiles over everything else, one line for each label of `by`."""
    x = np.asarray(axis.labels, float) * shown_on_figure(found, axis.name).factor
    figure = plots.kit.Figure(figsize=(plots.kit.PAGE_WIDTH, 3.0), layout="constrained")
    with plots.style():
        ax = figure.subplots()
        for i, (who, values) in enumerate(_series(found, name, by, axis)):
            _band(ax, i, x, quartiles(values), who)
        if (nothing := baseline_of(found, name)) is not None:
            ax.plot(
                x,
                quartiles(at_front(found, nothing, [axis]))[1],
                color="#7f7f7f",
                linestyle="--",
                label="doing nothing",
            )
        ax.set(xlabel=shown_on_figure(found, axis.name).label, ylabel=shown_on_figure(found, name).label)
        if _is_wide(x):
            ax.set_xscale("log")
        _scale(ax, at_front(found, name, []), "y")
        _told(ax, f"{found.seeds} seeds; median and quartiles", by)
    return figure


def heat_map(found: Swept, name: str, x: Axis, y: Axis, by: Axis | None = None) -> Any:
    """The median of a value over two axes of numbers, one panel for each label of `by`, all on one scale."""
    panels = [(who, quartiles(values)[1]) for who, values in _series(found, name, by, x, y)][:MOST_PANELS]
    finite = np.concatenate([values[np.isfinite(values)] for _, values in panels])
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure = plots.kit.Figure(figsize=(plots.kit.PAGE_WIDTH, 0.6 + 2.4 * rows), layout="constrained")
    with plots.style():
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        mesh = None
        for ax, (who, values) in zip(axes.flat, panels, strict=False):
            limits = {"vmin": finite.min(), "vmax": finite.max()} if finite.size else {}
            mesh = ax.pcolormesh(np.ma.masked_invalid(values.T), cmap="viridis", **limits)
            ax.set_title(who, fontweight="normal")
            ax.grid(visible=False)
            for way, axis in (("x", x), ("y", y)):
                ticks = [f"{value * shown_on_figure(found, axis.name).factor:.4g}" for value in axis.labels]
                ax.set(**{f"{way}ticks": np.arange(len(ticks)) + 0.5, f"{way}ticklabels": ticks})
        for ax in axes.flat[len(panels) :]:
            ax.set_visible(False)
        for ax in axes[-1]:
            ax.set_xlabel(shown_on_figure(found, x.name).label)
        for ax in axes[:, 0]:
            ax.set_ylabel(shown_on_figure(found, y.name).label)
        figure.colorbar(mesh, ax=axes, label=f"median {shown_on_figure(found, name).label}")
    return figure


def violins(found: Swept, name: str, axis: Axis) -> Any:
    """The distribution of a value over all runs, for each label of an axis, with its median and quartiles."""
    values = at_front(found, name, [axis])
    whole = [one[np.isfinite(one)] for one in values]
    log = _is_wide(values)
    drawn = [np.log10(one[one > 0]) if log else one for one in whole]
    figure = plots.kit.Figure(figsize=(plots.kit.PAGE_WIDTH, 3.2), layout="constrained")
    with plots.style():
        ax = figure.subplots()
        for i, one in enumerate(drawn):
            if one.size > 1 and np.ptp(one) > 0:
                bodies: Any = ax.violinplot(one, [i], widths=0.8, showextrema=False)["bodies"]
                for body in bodies:
                    body.set(facecolor=plots.kit.CYCLE[i % len(plots.kit.CYCLE)], alpha=0.35)
            if one.size:
                low, median, high = np.quantile(one, [0.25, 0.5, 0.75])
                ax.vlines(i, low, high, color="#000000", linewidth=3)
                ax.plot(i, median, "o", color="#ffffff", markeredgecolor="#000000", markersize=5)
        lost = [values.shape[1] - one.size for one in whole]
        ticks = [f"{label(w)}\n{n} not finite" if n else label(w) for w, n in zip(axis.labels, lost, strict=True)]
        ax.set(
            xticks=range(len(ticks)),
            xticklabels=ticks,
            ylabel=shown_on_figure(found, name).label,
            xlim=(-0.6, len(ticks) - 0.4),
        )
        if log:
            ax.yaxis.set_major_formatter(lambda power, _: f"{10.0**power:.3g}")
        ax.set_title(f"{values.shape[1]} runs each; median and quartiles", fontweight="normal")
    return figure


def rank_bars(found: Swept, name: str, axis: Axis) -> Any:
    """How often each label comes first, second, ... on the same runs, with the best average on top."""
    one = ranks(found, name, axis)
    order = np.argsort(-one.mean)
    figure = plots.kit.Figure(figsize=(plots.kit.PAGE_WIDTH, 0.9 + 0.35 * len(order)), layout="constrained")
    with plots.style():
        ax = figure.subplots()
        left = np.zeros(len(order))
        for place in range(len(order)):
            shares = 100 * one.shares[order, place]
            shade = 0.85 * place / max(1, len(order) - 1)
            ax.barh(range(len(order)), shares, left=left, color=str(0.1 + shade), label=f"{place + 1}.")
            left += shares
        means = ["-" if np.isnan(mean) else f"{mean:.2f}" for mean in one.mean]
        names = [f"{one.labels[i]} ({means[i]})" for i in order]
        ax.set(yticks=range(len(order)), yticklabels=names, xlabel="share of runs [%]", xlim=(0, 100))
        ax.set_title(f"ranks by {words_for(name)}, mean in brackets", fontweight="normal")
        figure.legend(loc="outside lower center", ncols=min(len(order), 10), title="place")
    return figure


def over_samples(found: Swept, name: str, axis: Axis, by: Axis | None = None) -> Any:
    """A value over each number of an axis of samples: median and quartiles of bins with equal numbers of samples."""
    columns = axis.columns or {}
    figure = plots.kit.Figure(figsize=(plots.kit.PAGE_WIDTH, 0.5 + 2.4 * -(-len(columns) // 2)), layout="constrained")
    with plots.style():
        axes = figure.subplots(-(-len(columns) // 2), min(2, len(columns)), squeeze=False, sharey=True)
        for ax, (part, numbers) in zip(axes.flat, columns.items(), strict=False):
            said = shown_on_figure(found, f"{axis.name}.{part}")
            groups = np.array_split(np.argsort(numbers), min(BINS, len(numbers)))
            middle = np.array([np.median(numbers[group]) for group in groups]) * said.factor
            for i, (who, values) in enumerate(_series(found, name, by, axis)):
                low, median, high = np.stack([quartiles(values[group].ravel()) for group in groups], axis=-1)
                ax.plot(
                    middle,
                    median,
                    MARKS[i % len(MARKS)],
                    color=plots.kit.CYCLE[i % len(plots.kit.CYCLE)],
                    markersize=3,
                    label=who,
                )
                ax.fill_between(
                    middle, low, high, color=plots.kit.CYCLE[i % len(plots.kit.CYCLE)], alpha=0.15, linewidth=0
                )
            ax.set_xlabel(said.label)
        for ax in axes.flat[len(columns) :]:
            ax.set_visible(False)
        _scale(axes[0, 0], at_front(found, name, []), "y")
        axes[0, 0].set_ylabel(shown_on_figure(found, name).label)
        _told(axes[0, 0], "median and quartiles", by)
    return figure


def _band(ax: Any, i: int, x: np.ndarray, three: np.ndarray, who: str) -> None:
    """The `i`-th line: the median of `three` (3, n) with its quartiles."""
    colour = plots.kit.CYCLE[i % len(plots.kit.CYCLE)]
    ax.plot(x, three[1], MARKS[i % len(MARKS)], color=colour, markersize=4, label=who or None)
    ax.fill_between(x, three[0], three[2], color=colour, alpha=0.15, linewidth=0)


def _series(found: Swept, name: str, by: Axis | None, *axes: Axis) -> Iterator[tuple[str, np.ndarray]]:
    """The values with these axes in front, (axes..., runs), for each label of `by`."""
    if by is None:
        yield "", at_front(found, name, axes)
        return
    for who, values in zip(by.labels, at_front(found, name, (by, *axes)), strict=True):
        yield str(who), values


def _is_wide(values: np.ndarray) -> bool:
    """Whether numbers are positive and differ so much in size that they need a logarithmic axis."""
    values = values[np.isfinite(values)]
    low, high = np.quantile(values, [0.05, 0.95]) if values.size else (1.0, 1.0)
    return bool(values.size and low > 0 and (values > 0).all() and high > SPREAD * low)


def _scale(ax: Any, values: np.ndarray, way: str) -> None:
    if _is_wide(values):
        ax.set(**{f"{way}scale": "log"})


def _told(ax: Any, title: str, by: Axis | None) -> None:
    ax.set_title(title, fontweight="normal")
    if ax.get_legend_handles_labels()[1]:
        ax.legend(title=None if by is None else words_for(by.name))
