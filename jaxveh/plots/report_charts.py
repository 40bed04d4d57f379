"""Zoomable charts of a log and its estimate, made with Bokeh: charts over time, the rear axle's curve, and the innovations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxveh._core.names import as_mapping
from jaxveh._core.recording import Recording
from jaxveh.io import kit
from jaxveh.plots.closeup import CHANNELS
from jaxveh.plots.estimates import BAND, HALF_BAND
from jaxveh.plots.innovations import HIGHEST, LOWEST, InnovationPoints
from jaxveh.plots.quantities import quantity
from jaxveh.plots.rear_axles import AxlePoints
from jaxveh.plots.style import COLOURS, CYCLE

MOST_ROWS = 30_000
"""Largest number of rows of a log on a page: more than a screen shows, and about 3 MB."""
MOST_POINTS = 6_000
"""Largest number of points of a tyre's curve on a page."""
SHOWN = ("sideslip", "v_y")
TOOLS = "xbox_zoom,box_zoom,xwheel_zoom,xwheel_pan,undo,reset,save"
"""Dragging zooms in time; with a pan tool Bokeh would pan instead. The window in the overview moves the view."""
FREE_TOOLS = "box_zoom,pan,wheel_zoom,undo,reset,save"
"""The tools of single charts."""
BANDS = ((BAND, 0.22, "95 % band"), (HALF_BAND, 0.4, "50 % band"))
CHANNEL = "#444444"


def require_bokeh() -> Any:
    """Import Bokeh; raise `InputError` with the way to install it if it is missing."""
    return kit.require("bokeh", "writing a report", "report")


def row_step(rows: int) -> int:
    """Return k such that every k-th row gives `MOST_ROWS` rows at most."""
    return -(-rows // MOST_ROWS)


def time_charts(
    estimate: Any, recording: Recording, truth: Mapping[str, Any] | None, others: Mapping[str, Mapping[str, Any]]
) -> Any:
    """Return Bokeh's layout of charts over one time (T rows each): estimates with bands, truth and others; errors; channels.

    They share the visible time, the cross hair and the tools."""
    require_bokeh()
    from bokeh.layouts import gridplot
    from bokeh.models import CrosshairTool, Range1d, Span

    source = time_source(estimate, recording, truth or {}, others)
    time = np.asarray(recording.time)
    shared = {"x_range": Range1d(float(time[0]), float(time[-1]), bounds="auto"), "source": source}
    charts = []
    for name in SHOWN:
        charts.append(_estimate_chart(name, list(others), shared, 300 if name == SHOWN[0] else 220))
        if f"error.{name}" in source.data:
            charts.append(_error_chart(name, shared))
    charts += [_channel_chart(name, recording, shared) for name in CHANNELS if name in recording]
    charts[-1].xaxis.axis_label = "time [s]"
    charts[-1].height += 25
    hair = Span(dimension="height", line_color="#888888", line_width=1)
    for chart in charts:
        chart.add_tools(CrosshairTool(overlay=hair))
    return gridplot(
        [[_overview(shared)], *[[chart] for chart in charts]], merge_tools=True, toolbar_location="right",
        sizing_mode="stretch_width", toolbar_options={"logo": None},
    )  # fmt: skip


def time_source(
    estimate: Any, recording: Recording, truth: Mapping[str, Any], others: Mapping[str, Mapping[str, Any]]
) -> Any:
    """Return the thinned columns of the charts in the displayed units: time in double, all others in single precision."""
    from bokeh.models import ColumnDataSource

    step = slice(None, None, row_step(len(recording)))
    mean, std = as_mapping(estimate.mean, "mean"), as_mapping(estimate.std, "std")
    columns: dict[str, np.ndarray] = {}
    for name in SHOWN:
        shown = quantity(name)
        columns[name], columns[f"std.{name}"] = shown.show(mean[name]), shown.show(std[name])
        if name in truth:
            columns[f"truth.{name}"] = shown.show(truth[name])
            columns[f"error.{name}"] = columns[name] - columns[f"truth.{name}"]
        columns |= {f"{label}.{name}": shown.show(values[name]) for label, values in others.items() if name in values}
    columns |= {
        f"log.{name}": quantity(name, recording.unit(name)).show(recording[name])
        for name in CHANNELS
        if name in recording
    }
    data = {name: np.ascontiguousarray(values[step], np.float32) for name, values in columns.items()}
    return ColumnDataSource({"time": np.ascontiguousarray(np.asarray(recording.time, np.float64)[step]), **data})


def _chart(label: str, shared: Mapping[str, Any], height: int) -> Any:
    from bokeh.plotting import figure

    chart = figure(
        height=height,
        x_range=shared["x_range"],
        tools=TOOLS,
        title=_title(label),
        min_border_left=60,
        min_border_right=20,
    )
    chart.outline_line_color = None
    chart.grid.grid_line_color = "#e6e6e6"
    chart.yaxis.ticker.desired_num_ticks = 4 if height < 150 else 6
    chart.axis.axis_label_text_font_style = "normal"
    return chart


def _title(words: str) -> Any:
    from bokeh.models import Title

    return Title(text=words, text_font_style="normal", text_font_size="13px")


def _edge(centre: str, std: str, width: float) -> Any:
    """Return a band's edge, which the browser computes from mean and standard deviation."""
    from bokeh.models import CustomJSExpr

    code = "const m = this.data[centre], s = this.data[std]; return Float64Array.from(m, (v, i) => v + width * s[i])"
    return CustomJSExpr(args={"centre": centre, "std": std, "width": width}, code=code)


def _bands(chart: Any, centre: str, std: str, source: Any) -> None:
    for width, alpha, words in BANDS:
        low, high = _edge(centre, std, -width), _edge(centre, std, width)
        chart.varea("time", low, high, source=source, color=CYCLE[0], alpha=alpha, legend_label=words)


def _estimate_chart(name: str, others: list[str], shared: Mapping[str, Any], height: int) -> Any:
    source, shown = shared["source"], quantity(name)
    chart = _chart(shown.label, shared, height)
    line = lambda column, colour, width, words: chart.line(
        "time", column, source=source, color=colour, line_width=width, legend_label=words
    )
    _bands(chart, name, f"std.{name}", source)
    tips = [("time", "@time{0.00} s"), ("estimate", f"@{{{name}}}{{0.000}} {shown.unit}"),
            ("std", f"@{{std.{name}}}{{0.000}} {shown.unit}")]  # fmt: skip
    if f"truth.{name}" in source.data:
        line(f"truth.{name}", COLOURS["truth"], 1.6, "truth")
        tips.append(("truth", f"@{{truth.{name}}}{{0.000}} {shown.unit}"))
    for index, label in enumerate(others):
        if f"{label}.{name}" in source.data:
            line(f"{label}.{name}", CYCLE[index + 2], 1.2, label)
            tips.append((label, f"@{{{label}.{name}}}{{0.000}} {shown.unit}"))
    _hover(chart, line(name, CYCLE[0], 1.3, "estimate"), tips)
    _legend(chart)
    return chart


def _error_chart(name: str, shared: Mapping[str, Any]) -> Any:
    from bokeh.models import Span

    source, shown = shared["source"], quantity(name)
    chart = _chart(f"error: {shown.label}", shared, 170)
    _bands(chart, f"error.{name}", f"std.{name}", source)
    drawn = chart.line("time", f"error.{name}", source=source, color=CYCLE[0], line_width=1.2)
    chart.add_layout(Span(location=0, dimension="width", line_color=COLOURS["truth"], line_width=1))
    tips = [("time", "@time{0.00} s"), ("error", f"@{{error.{name}}}{{0.000}} {shown.unit}"),
            ("std", f"@{{std.{name}}}{{0.000}} {shown.unit}")]  # fmt: skip
    _hover(chart, drawn, tips)
    chart.legend.visible = False
    return chart


def _channel_chart(name: str, recording: Recording, shared: Mapping[str, Any]) -> Any:
    shown = quantity(name, recording.unit(name))
    chart = _chart(shown.label, shared, 135)
    drawn = chart.line("time", f"log.{name}", source=shared["source"], color=CHANNEL, line_width=1.1)
    _hover(chart, drawn, [("time", "@time{0.00} s"), (name, f"@{{log.{name}}}{{0.000}} {shown.unit}")])
    return chart


def _overview(shared: Mapping[str, Any]) -> Any:
    """Return a small chart of the whole log, with a movable window."""
    from bokeh.models import Range1d, RangeTool
    from bokeh.plotting import figure

    time = shared["source"].data["time"]
    label = f"{quantity('sideslip').label}: the charts below show the window"
    chart = figure(
        height=80, tools="", x_range=Range1d(time[0], time[-1]), title=_title(label), min_border_left=60, min_border_right=20,
        toolbar_location=None,
    )  # fmt: skip
    chart.line("time", "sideslip", source=shared["source"], color=CYCLE[0])
    window = RangeTool(x_range=shared["x_range"])
    window.overlay.fill_color, window.overlay.fill_alpha = "#e69f00", 0.2
    chart.add_tools(window)
    chart.yaxis.visible, chart.outline_line_color, chart.ygrid.visible = False, None, False
    return chart


def _hover(chart: Any, drawn: Any, tips: list[tuple[str, str]]) -> None:
    from bokeh.models import HoverTool

    chart.add_tools(HoverTool(renderers=[drawn], tooltips=tips, mode="vline"))


def _legend(chart: Any) -> None:
    """Place the legend above the chart; a click on an entry hides its line."""
    legend = chart.legend[0]
    legend.orientation, legend.location = "horizontal", "left"
    legend.click_policy, legend.border_line_color = "hide", None
    legend.label_text_font_size, legend.padding, legend.spacing = "12px", 0, 14
    chart.add_layout(legend, "above")


def axle_chart(points: AxlePoints) -> Any:
    """Return Bokeh's chart of the rear axle's curve, its band and the visited points, thinned."""
    require_bokeh()
    from bokeh.plotting import figure

    chart = figure(
        height=420, width=860, tools=FREE_TOOLS, x_axis_label="slip angle of the rear axle [°]",
        y_axis_label="lateral force over load [1]", min_border_left=60,
    )  # fmt: skip
    chart.toolbar.logo = None
    chart.axis.axis_label_text_font_style = "normal"
    slip, share = np.degrees(points.visited_slip), points.visited_share
    for which, shade, words in (
        (~points.turning, "#b5b5b5", "visited while driving or braking hard"),
        (points.turning, CYCLE[4], "visited"),
    ):
        rows = np.flatnonzero(which)
        rows = rows[:: -(-max(rows.size, 1) // (MOST_POINTS // 2))]
        at = {"x": slip[rows].astype(np.float32), "y": share[rows].astype(np.float32)}
        chart.scatter("x", "y", source=at, size=3, color=shade, alpha=0.5, legend_label=words)
    degrees = np.degrees(points.slip).astype(np.float32)
    if points.low is not None and points.high is not None:
        known = np.isfinite(points.low) & np.isfinite(points.high)
        chart.varea(
            degrees[known], points.low[known], points.high[known], color=CYCLE[0], alpha=0.25, legend_label="95 % band"
        )
    words = "curve of the car file" if points.low is None else "calibrated curve"
    drawn = chart.line(degrees, points.share, color=CYCLE[0], line_width=2, legend_label=words)
    from bokeh.models import HoverTool

    chart.add_tools(HoverTool(renderers=[drawn], tooltips=[("slip angle", "@x{0.00} °"), ("force", "@y{0.000}")]))
    _legend(chart)
    return chart


def innovation_charts(points: InnovationPoints) -> Any:
    """Return Bokeh's layout of a channel's averaged normalised innovations squared over time, and their correlation over lags."""
    require_bokeh()
    from bokeh.layouts import column
    from bokeh.models import BoxAnnotation

    words = points.name.replace("_", " ")
    numbers = f"mean {points.by_row:.2g} by row, {points.by_sums:.2g} by sums of {points.seconds:g} s"
    over_time = _small_chart(
        f"normalised innovation squared of {words}, mean over {points.seconds:g} s [1]: {numbers}", "time [s]",
        y_axis_type="log", y_range=(LOWEST, HIGHEST),
    )  # fmt: skip
    over_time.add_layout(BoxAnnotation(bottom=points.low, top=points.high, fill_color=CYCLE[2], fill_alpha=0.2))
    rows = slice(None, None, row_step(points.time.size))
    mean = np.clip(points.mean, LOWEST, HIGHEST)[rows].astype(np.float32)
    drawn = over_time.line(points.time[rows], mean, color=CYCLE[0])
    _hover(over_time, drawn, [("time", "@x{0.00} s"), ("mean", "@y{0.00}")])
    over_lag = _small_chart(f"correlation of innovations of {words} [1]", "lag [s]")
    lag, band = (values.astype(np.float32) for values in (points.lag, points.band))
    over_lag.varea(lag, -band, band, color=CYCLE[2], alpha=0.2)
    over_lag.segment(lag, np.zeros_like(lag), lag, points.correlation.astype(np.float32), color=CYCLE[0])
    return column(over_time, over_lag, sizing_mode="stretch_width")


def _small_chart(title: str, below: str, **more: Any) -> Any:
    from bokeh.plotting import figure

    chart = figure(
        height=220, tools=FREE_TOOLS, title=_title(title), x_axis_label=below,
        min_border_left=60, sizing_mode="stretch_width", **more,
    )  # fmt: skip
    chart.toolbar.logo = None
    chart.axis.axis_label_text_font_style = "normal"
    return chart
