"""One page about the logs of a car: tables, and zoomable charts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from jaxveh._core.errors import InputError, check_kind
from jaxveh._core.recording import Recording
from jaxveh.plots import report_page as html
from jaxveh.plots.innovations import InnovationPoints
from jaxveh.plots.rear_axles import AxlePoints
from jaxveh.plots.report_charts import axle_chart, innovation_charts, require_bokeh, row_step, time_charts
from jaxveh.plots.report_page import ReportTable


class ReportedLog(NamedTuple):
    """One log of a report.

    `name`: its name; `estimate`: of sideslip, and `recording`: with the same T rows; `truth`: names to (T,), None if there is
    none; `others`: labels to such mappings, as in `plots.estimate`; `axle`: of `plots.rear_axle_points`, None if there is none;
    `innovations`: of `plots.innovation_points`; `tables`: the tables before its charts.
    """

    name: str
    estimate: Any
    recording: Recording
    truth: Mapping[str, Any] | None = None
    others: Mapping[str, Mapping[str, Any]] = {}
    axle: AxlePoints | None = None
    innovations: Sequence[InnovationPoints] = ()
    tables: Sequence[ReportTable] = ()


def log_report(logs: Sequence[ReportedLog], *, title: str = "Sideslip", tables: Sequence[ReportTable] = ()) -> str:
    """Return the text of a self-contained HTML page that opens without a network; Bokeh is the extra `report`.

    It has `tables`, then for each log its own tables, charts over one time of the estimate with bands of 50 and 95 %, of the
    error and of the channels, the rear axle's curve, and the filter's innovations.

    Charts of more than `report_charts.MOST_ROWS` rows show only every k-th row, with a note. Values are in single precision.

    **Raises** `InputError` if there is no log, rows do not agree, or Bokeh is missing.
    """
    require_bokeh()
    from bokeh.embed import components
    from bokeh.resources import Resources

    if not logs:
        raise InputError("plots.log_report: no log to report on; give at least one.")
    for log in logs if isinstance(logs, list | tuple) and not hasattr(logs, "_fields") else [logs]:
        check_kind("plots.log_report: logs", log, ReportedLog, "Give a list of them.")
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
    """Return a log's part of the page."""
    step = row_step(len(log.recording))
    thinned = "" if step == 1 else f" The charts show one row in {step} of {len(log.recording)}; the tables are of all."
    parts = [
        html.heading(log.name, f"log-{index}"),
        *[html.table(one) for one in log.tables],
        "<h3>Estimate and channels over time</h3>",
        html.note(
            "Drag over a chart to zoom all of them in time; the buttons on the right undo it. A click in a legend hides a "
            f"line.{thinned}"
        ),
        places[f"time-{index}"],
    ]
    if f"axle-{index}" in places:
        parts += ["<h3>Rear axle: the curve and the visited points</h3>", places[f"axle-{index}"]]
    if log.innovations:
        parts += [
            "<h3>Innovations: whether the filter's standard deviations fit the measurements</h3>",
            html.note(
                "The measurements less their predictions, over the predicted standard deviations. The squares are 1 on average "
                "if the standard deviations are right: by row, or, if errors last for many rows and the filter models them as "
                "larger white noise, by sums (rows then have less than 1, and are correlated). Look at the times far above the "
                "band in the charts above."
            ),
            *[places[f"innovation-{index}-{k}"] for k in range(len(log.innovations))],
        ]
    return parts
