"""Whether a filter's spreads fit what it met: normalised innovations squared over time, and their correlation from row to row."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh.diagnostics import Consistency, chi_squared_band, nis_by_channel, whiteness
from jaxveh.plots.style import COLOURS, CYCLE, label_above, legend, new_figure, style

FAINT = "#9a9a9a"
LOWEST, HIGHEST = 1e-3, 1e2
"""Between which normalised innovations squared are shown, at most."""


def innovations(estimate: Any, *, seconds: float = 1.0, lags: int = 100, figure: Any = None) -> Any:
    """A row a measured channel: its normalised innovation squared over time, with the mean over `seconds` and the band of 95 %
    that the mean of a filter with right spreads stays within; on the right its correlation from row to row, with the band of
    white innovations.

    Beside the mean square of rows stands that of sums over `seconds` (`slow_squares`): measurement errors that last for many
    rows, as behind a low-pass, are modelled as white noise that is larger row by row, and show as small squares, correlated,
    whose sums are right.

    **Arguments**: `estimate`: an `Estimate`, or a smoother's, whose filter is looked at. `lags`: rows, at most a quarter of the
    log. `figure`: where to draw.

    **Returns** the figure. **Raises** `InputError` where nothing was measured, or spreads are not finite.
    """
    check_positive("seconds", seconds, "s")
    filtered = getattr(estimate, "filtered", estimate)
    time = np.asarray(filtered.time, np.float64)
    if time.size < 8:
        raise InputError(f"plots.innovations: {time.size} rows are too few.")
    channels = nis_by_channel(filtered)
    found = whiteness(filtered, lags=min(lags, time.size // 4))
    width = max(1, round(seconds / float(np.median(np.diff(time)))))
    with style():
        figure = new_figure(0.75 + 2.2 * len(channels)) if figure is None else figure
        axes = figure.subplots(len(channels), 2, sharex="col", squeeze=False, width_ratios=[3, 2])
        for row, (name, one) in zip(axes, channels.items(), strict=True):
            white = getattr(filtered.info.innovation, name) / getattr(filtered.info.innovation_std, name)
            slow = slow_squares(np.asarray(white, np.float64), width)
            _squared(row[0], time, name, one, slow, width, seconds)
            _correlation(row[1], found, found.channels.index(name), float(np.median(np.diff(time))))
        axes[-1, 0].set_xlabel("time [s]")
        axes[-1, 1].set_xlabel("lag [s]")
        legend(figure, axes)
    return figure


def _squared(ax: Any, time: np.ndarray, name: str, found: Consistency, slow: float, width: int, seconds: float) -> None:
    """One channel's normalised innovations squared, on a scale of powers of ten."""
    squared = np.asarray(found.by_row)
    known = np.isfinite(squared)
    ax.plot(time[known], np.clip(squared[known], LOWEST, HIGHEST), ".", color=FAINT, markersize=1.2, label="a row")
    count = np.convolve(known, np.ones(width), "same")
    total = np.convolve(np.where(known, squared, 0.0), np.ones(width), "same")
    enough = count >= width / 2
    mean = np.where(enough, total / np.maximum(count, 1), np.nan)
    low, high = (edge / width for edge in chi_squared_band(width))
    ax.axhspan(low, high, color=CYCLE[2], alpha=0.2, linewidth=0, label="95 % of means, if the spreads are right")
    ax.plot(time, np.clip(mean, LOWEST, HIGHEST), color=CYCLE[0], linewidth=1.2, label=f"mean over {seconds:g} s")
    ax.axhline(1.0, color=COLOURS["truth"], linewidth=0.8)
    ax.set_yscale("log")
    ax.set_ylim(LOWEST, HIGHEST)
    label_above(ax, f"normalised innovation squared of {name.replace('_', ' ')} [1]")
    _write(ax, f"expected 1; mean {found.mean:.2g} by row, {slow:.2g} by {seconds:g} s")


def _correlation(ax: Any, found: Any, channel: int, step: float) -> None:
    """One channel's correlation with itself so many rows later."""
    lags, values = found.lags * step, found.correlations[:, channel, channel]
    band = found.band[:, channel, channel]
    ax.fill_between(lags, -band, band, color=CYCLE[2], alpha=0.2, linewidth=0)
    ax.vlines(lags, 0.0, values, color=CYCLE[0], linewidth=1.3)
    ax.axhline(0.0, color=COLOURS["truth"], linewidth=0.8)
    reach = max(0.1, 1.15 * float(np.nanmax(np.abs(values))), 1.5 * float(np.nanmax(band)))
    ax.set_ylim(-reach, reach)
    label_above(ax, "correlation of innovations [1]")
    _write(ax, f"{100 * np.mean(np.abs(values) <= band):.0f} % of lags in the band")


def slow_squares(white: np.ndarray, width: int) -> float:
    """The mean square of the sums of `width` rows' normalised innovations (T,), over their number: 1 if they are white and of
    unit variance, more where errors last for many rows. NaN without a whole part."""
    count = white.size // width
    parts = np.nan_to_num(white[: count * width]).reshape(count, width)
    known = np.isfinite(white[: count * width]).reshape(count, width).sum(axis=1)
    whole = known >= width / 2
    return float(np.mean(parts[whole].sum(axis=1) ** 2 / known[whole])) if whole.any() else np.nan


def _write(ax: Any, text: str) -> None:
    """Numbers of a panel, in its upper right corner."""
    box = {"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.5}
    ax.text(0.99, 0.97, text, transform=ax.transAxes, ha="right", va="top", fontsize=8, color="#444444", bbox=box)
