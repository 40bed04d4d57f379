"""The consistency of a filter's innovations: normalised innovations squared over time, and their correlation over lags."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh.diagnostics import chi_squared_band, nis_by_channel, whiteness
from jaxveh.plots.estimates import check_estimate
from jaxveh.plots.style import COLOURS, CYCLE, label_above, legend, new_figure, style

FAINT = "#9a9a9a"
LOWEST, HIGHEST = 1e-3, 1e2
"""The range in which normalised innovations squared are shown."""


class InnovationPoints(NamedTuple):
    """Normalised innovations squared of one measured channel, `name`, over T rows, and their correlation over lags.

    `time` (s) and `squared` (T,), NaN without a measurement; `mean` (T,), over `seconds` around a row, NaN where less than half
    of its rows have a measurement; `low`, `high`: the band of 95 % of such means if the standard deviations are right; `by_row`,
    `by_sums`: means of squares and of `slow_squares`; both are 1 if all is right. `lag` (L,), s, `correlation` and `band` (L,):
    of normalised innovations at that lag, and the band of 95 % of them if they are white.
    """

    name: str
    time: np.ndarray
    squared: np.ndarray
    seconds: float
    mean: np.ndarray
    low: float
    high: float
    by_row: float
    by_sums: float
    lag: np.ndarray
    correlation: np.ndarray
    band: np.ndarray


def innovations(estimate: Any, *, seconds: float = 1.0, lags: int = 100, figure: Any = None) -> Any:
    """Draw a row per measured channel: its normalised innovation squared over time, and on the right its correlation over lags.

    The mean over `seconds` is drawn with the band that contains 95 % of such means if the filter's standard deviations are
    right, the correlation with the band of white innovations.

    The mean square of sums over `seconds` (`slow_squares`) is written beside that of rows: measurement errors that last for many
    rows, as after a low-pass, are modelled as white noise that is larger in each row, and give small, correlated squares whose
    sums are right.

    **Arguments**: as `innovation_points`. `figure`: the figure to draw into. **Returns** the figure.
    """
    channels = innovation_points(estimate, seconds=seconds, lags=lags)
    with style():
        figure = new_figure(0.75 + 2.2 * len(channels)) if figure is None else figure
        axes = figure.subplots(len(channels), 2, sharex="col", squeeze=False, width_ratios=[3, 2])
        for row, one in zip(axes, channels, strict=True):
            _squared(row[0], one)
            _correlation(row[1], one)
        axes[-1, 0].set_xlabel("time [s]")
        axes[-1, 1].set_xlabel("lag [s]")
        legend(figure, axes)
    return figure


def innovation_points(estimate: Any, *, seconds: float = 1.0, lags: int = 100) -> tuple[InnovationPoints, ...]:
    """Return the data of `innovations`, one entry per measured channel.

    **Arguments**: `estimate`: an `Estimate`, or that of a smoother, whose filter is used. `lags`: rows, at most a quarter of the
    log. **Raises** `InputError` if there is no measurement, or standard deviations are not finite.
    """
    check_positive("seconds", seconds, "s")
    filtered = getattr(estimate, "filtered", estimate)
    check_estimate("plots.innovations", filtered, "info")
    time = np.asarray(filtered.time, np.float64)
    if time.size < 8:
        raise InputError(f"plots.innovations: {time.size} rows are too few.")
    found = whiteness(filtered, lags=min(lags, time.size // 4))
    step = float(np.median(np.diff(time)))
    width = max(1, round(seconds / step))
    low, high = (edge / width for edge in chi_squared_band(width))
    channels = []
    for name, one in nis_by_channel(filtered).items():
        white = getattr(filtered.info.innovation, name) / getattr(filtered.info.innovation_std, name)
        squared, index = np.asarray(one.by_row), found.channels.index(name)
        correlation, band = (values[:, index, index] for values in (found.correlations, found.band))
        slow = slow_squares(np.asarray(white, np.float64), width)
        mean = _running_mean(squared, width)
        found_here = (name, time, squared, seconds, mean, low, high, one.mean, slow)
        channels.append(InnovationPoints(*found_here, found.lags * step, correlation, band))
    return tuple(channels)


def _running_mean(values: np.ndarray, width: int) -> np.ndarray:
    """Return the mean over `width` rows, NaN where less than half of them are known."""
    known = np.isfinite(values)
    count = np.convolve(known, np.ones(width), "same")
    total = np.convolve(np.where(known, values, 0.0), np.ones(width), "same")
    return np.where(count >= width / 2, total / np.maximum(count, 1), np.nan)


def _squared(ax: Any, one: InnovationPoints) -> None:
    """Draw one channel's normalised innovations squared, on a logarithmic scale."""
    known = np.isfinite(one.squared)
    ax.plot(
        one.time[known], np.clip(one.squared[known], LOWEST, HIGHEST), ".", color=FAINT, markersize=1.2, label="a row"
    )
    ax.axhspan(one.low, one.high, color=CYCLE[2], alpha=0.2, linewidth=0, label="95 % of means of a consistent filter")
    mean = np.clip(one.mean, LOWEST, HIGHEST)
    ax.plot(one.time, mean, color=CYCLE[0], linewidth=1.2, label=f"mean over {one.seconds:g} s")
    ax.axhline(1.0, color=COLOURS["truth"], linewidth=0.8)
    ax.set_yscale("log")
    ax.set_ylim(LOWEST, HIGHEST)
    label_above(ax, f"normalised innovation squared of {one.name.replace('_', ' ')} [1]")
    _write(ax, f"expected 1; mean {one.by_row:.2g} by row, {one.by_sums:.2g} by {one.seconds:g} s")


def _correlation(ax: Any, one: InnovationPoints) -> None:
    """Draw one channel's correlation with itself over lags."""
    ax.fill_between(one.lag, -one.band, one.band, color=CYCLE[2], alpha=0.2, linewidth=0)
    ax.vlines(one.lag, 0.0, one.correlation, color=CYCLE[0], linewidth=1.3)
    ax.axhline(0.0, color=COLOURS["truth"], linewidth=0.8)
    reach = max(0.1, 1.15 * float(np.nanmax(np.abs(one.correlation))), 1.5 * float(np.nanmax(one.band)))
    ax.set_ylim(-reach, reach)
    label_above(ax, "correlation of innovations [1]")
    _write(ax, f"{100 * np.mean(np.abs(one.correlation) <= one.band):.0f} % of lags in the band")


def slow_squares(white: np.ndarray, width: int) -> float:
    """Return the mean square of the sums of normalised innovations (T,) over `width` rows, divided by their number.

    It is 1 if they are white with unit variance, and more if errors last for many rows. It is NaN if no part of `width` rows
    has enough of them.
    """
    count = white.size // width
    parts = np.nan_to_num(white[: count * width]).reshape(count, width)
    known = np.isfinite(white[: count * width]).reshape(count, width).sum(axis=1)
    whole = known >= width / 2
    return float(np.mean(parts[whole].sum(axis=1) ** 2 / known[whole])) if whole.any() else np.nan


def _write(ax: Any, text: str) -> None:
    """Write the numbers of a panel into its upper right corner."""
    box = {"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.5}
    ax.text(0.99, 0.97, text, transform=ax.transAxes, ha="right", va="top", fontsize=8, color="#444444", bbox=box)
