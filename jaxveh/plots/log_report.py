"""One page of what became of a car's logs: tables, and charts that one can zoom into."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh.plots import report_page as html
from jaxveh.plots.innovations import InnovationPoints
from jaxveh.plots.rear_axles import AxlePoints
from jaxveh.plots.report_charts import axle_chart, innovation_charts, require_bokeh, row_step, time_charts
from jaxveh.plots.report_page import ReportTable


class ReportedLog(NamedTuple):
    """One log of a report: its `name`; `estimate`, of sideslip, and `recording` with the same T rows; `truth`: names to (T,),
    None without; `others`: labels to such, as in `plots.estimate`; `axle`: of `plots.rear_axle_points`, None without;
    `innovations`: of `plots.innovation_points`; `tables`, which stand before its charts."""

    name: str
    estimate: Any
    recording: Recording
    truth: Mapping[str, Any] | None = None
    others: Mapping[str, Mapping[str, Any]] = {}
    axle: AxlePoints | None = None
    innovations: Sequence[InnovationPoints] = ()
    tables: Sequence[ReportTable] = ()


def log_report(logs: Sequence[ReportedLog], *, title: str = "Sideslip", tables: Sequence[ReportTable] = ()) -> str:
    """The text of a page of HTML that holds all that it needs, and opens without a network: `tables`, then for each log its own
    tables and charts of the estimate with bands of 50 and 95 %, the error, the channels, all over one time, the rear axle's
    curve, and the filter's innovations; Bokeh is the extra `report`.

    Charts of more than `report_charts.MOST_ROWS` rows show each so manieth, and say so. Values are held in single precision.

    **Raises** `InputError` without a log, where rows do not agree, or where Bokeh is missing.
    """
    require_bokeh()
    from bokeh.embed import components
    from bokeh.resources import Resources

    if not logs:
        raise InputError("plots.log_report: no log to report on; give at least one.")
    for log in logs:
        rows = len(log.estimate.time)
        if rows != len(log.recording):
            raise InputError(
                f"plots.log_report: {log.name}: {rows} rows estimated, {len(log.recording)} recorded; must agree."
            )
    charts = {}
    for i, log in enumerate(logs):
        charts[f"time-{i}"] = time_charts(log.estimate, log.recording, log.truth, log.others)
        if log.axle is not None:
            charts[f"axle-{i}"] = axle_chart(log.axle)
        for k, one in enumerate(log.innovations):
            charts[f"innovation-{i}-{k}"] = innovation_charts(one)
    script, places = components(charts)
    head = Resources(mode="inline", components=["bokeh"], minified=True).render()
    parts = [html.table(one) for one in tables]
    if len(logs) > 1:
        parts.insert(0, html.links([(f"log-{i}", log.name) for i, log in enumerate(logs)]))
    for i, log in enumerate(logs):
        parts += _section(log, i, places)
    return html.page(title, head, [*parts, script])


def _section(log: ReportedLog, index: int, places: Mapping[str, str]) -> list[str]:
    """A log's part of the page."""
    step = row_step(len(log.recording))
    thinned = "" if step == 1 else f" The charts show one row in {step} of {len(log.recording)}; the tables are of all."
    parts = [
        html.heading(log.name, f"log-{index}"),
        *[html.table(one) for one in log.tables],
        "<h3>Estimate and channels over time</h3>",
        html.note(
            "Drag over a chart to zoom all of them in time; the buttons on the right take it back. A click in a legend hides a "
            f"line.{thinned}"
        ),
        places[f"time-{index}"],
    ]
    if f"axle-{index}" in places:
        parts += ["<h3>Rear axle: the curve and the points visited</h3>", places[f"axle-{index}"]]
    if log.innovations:
        parts += [
            "<h3>Innovations: whether the filter's spreads fit what it met</h3>",
            html.note(
                "What the measurements say less what the filter expected, over the spread that it expected. Squared it is 1 on "
                "average where spreads are right: row by row, or, where errors last for many rows and the filter takes them for "
                "white noise that is larger, by sums (rows then say less than 1, and are correlated). Times far above the band "
                "are those to look at in the charts above."
            ),
            *[places[f"innovation-{index}-{k}"] for k in range(len(log.innovations))],
        ]
    return parts
