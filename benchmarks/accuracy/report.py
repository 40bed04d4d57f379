"""The table, and the summary of all lines."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

import numpy as np

from .logs import REFERENCE
from .measure import Line

HEAD = (
    "log", "setting", "RMSE [deg]", "open loop", "as told", "over open loop", "over as told", "without constant",
    "worst", "in 50 %", "in 95 %", "CRPS", "constant band",
)  # fmt: skip


def show(lines: Sequence[Line], title: str) -> None:
    """Print a table of lines."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", caption=_caption(), caption_justify="left")
    for i, name in enumerate(HEAD):
        table.add_column(name, justify="left" if i < 2 else "right")
    for line in lines:
        table.add_row(*_cells(line))
    Console(width=180).print(table)
    for line in lines:
        if line.failed:
            print(f"{line.log}, {line.setting}: {line.failed}")


def _caption() -> str:
    return (
        "without constant: the errors' part that is not constant, over that of the open loop; constant band: CRPS of the same "
        "estimate with the one constant band that suits it best"
    )


def _cells(line: Line) -> list[str]:
    if line.failed:
        return [line.log, line.setting, "failed", *[""] * (len(HEAD) - 3)]
    digits = lambda value, places=3: f"{value:.{places}f}"
    return [
        line.log, line.setting, digits(line.rmse), digits(line.open_loop), digits(line.as_told),
        digits(line.over_open_loop, 2), digits(line.over_as_told, 2), digits(line.over_open_loop_without_constant, 2),
        digits(line.worst, 1), digits(line.coverage_50, 2), digits(line.coverage_95, 2),
        digits(line.crps), digits(line.crps_constant),
    ]  # fmt: skip


def summary(lines: Sequence[Line]) -> dict[str, float]:
    """Summarise many lines of one setting: quantiles of the error over that of the open loop, shares, and coverage."""
    done = [line for line in lines if not line.failed]
    if not done:
        return {"runs": len(lines), "failed": len(lines)}
    over = [line.over_open_loop for line in done]
    return {
        "runs": len(lines),
        "failed": len(lines) - len(done),
        "over_open_loop_median": statistics.median(over),
        "over_open_loop_90": float(np.quantile(over, 0.9)),
        "over_open_loop_worst": max(over),
        "worse_than_open_loop": float(np.mean([value > 1.0 for value in over])),
        "over_as_told_median": statistics.median(line.over_as_told for line in done),
        "over_as_told_worst": max(line.over_as_told for line in done),
        "rmse_median_deg": statistics.median(line.rmse for line in done),
        "open_loop_median_deg": statistics.median(line.open_loop for line in done),
        "coverage_50": float(np.mean([line.coverage_50 for line in done])),
        "coverage_95": float(np.mean([line.coverage_95 for line in done])),
        "coverage_95_lowest": min(line.coverage_95 for line in done),
        "coverage_95_lowest_tenth": float(np.quantile([line.coverage_95 for line in done], 0.1)),
        "crps_over_constant_band": statistics.median(line.crps / line.crps_constant for line in done),
    }


COURSE_HEAD = {
    "RMSE [deg]": "rmse_median_deg", "open loop": "open_loop_median_deg", "over open loop": "over_open_loop_median",
    "worst": "over_open_loop_worst", "over as told": "over_as_told_median", "worst, as told": "over_as_told_worst",
    "in 95 %": "coverage_95", "lowest": "coverage_95_lowest",
}  # fmt: skip
"""Columns of the table of courses, medians unless stated otherwise, and their names in a `summary`."""


def show_courses(summaries: Mapping[str, Mapping[str, float]], title: str) -> None:
    """Print a table with the summary of each course."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for i, name in enumerate(("course", "drives", "failed", *COURSE_HEAD)):
        table.add_column(name, justify="left" if i == 0 else "right")
    for course, about in summaries.items():
        values = [f"{about[name]:.2f}" if name in about else "" for name in COURSE_HEAD.values()]
        table.add_row(course, str(about["runs"]), str(about["failed"]), *values)
    Console(width=180).print(table)


AT_MOST = {
    "Genesis": ("over_open_loop_without_constant", 0.75),
    "F1TENTH": ("over_open_loop", 0.6),
    "AV-21 at its reference's point": ("over_open_loop", 0.6),
    "Ferrari, forward": ("rmse", 0.24),
    "Ferrari, reversed": ("rmse", 0.33),
}
"""Bounds for a log's lines, or for one setting of it: a ratio to the open loop, or an error in degrees."""

COVERAGE = (0.88, 0.99)
"""Allowed coverage of 95 % bands, for logs that are estimated without their reference."""

SHARE = 1.02
"""Bound of the error over that of simpler estimates, the open loop and the values of the car file."""


def criteria(lines: Sequence[Line]) -> list[str]:
    """Return the criteria of each blind line of a log in words: whether it holds, the value and the bound."""
    found = []
    for line in lines:
        if line.failed or REFERENCE in line.setting:
            continue
        ratio = line.rmse / min(line.open_loop, line.as_told)
        asked = [("error over the best of what is simpler", ratio, 0.0, SHARE)]
        for of, (name, most) in AT_MOST.items():
            if f"{line.log}, {line.setting}".startswith(f"{of},"):
                asked.append((name.replace("_", " "), getattr(line, name), 0.0, most))
        asked.append(("95 % band covers", line.coverage_95, *COVERAGE))
        found += [f"{line.log}, {line.setting}: {_verdict(*one)}" for one in asked]
    return found


def fleet_criteria(about: dict[str, float]) -> list[str]:
    """Return the criteria of a fleet's summary in words."""
    if "over_open_loop_median" not in about:
        return []
    asked = (
        ("median over open loop", about["over_open_loop_median"], 0.0, 0.5),
        ("share worse than open loop", about["worse_than_open_loop"], 0.0, 0.02),
        ("95 % band covers", about["coverage_95"], 0.92, 0.98),
    )
    return [f"fleet: {_verdict(*one)}" for one in asked]


def _verdict(what: str, value: float, low: float, high: float) -> str:
    bounds = f"at most {high:g}" if low == 0 else f"{low:g} to {high:g}"
    return f"{what} {value:.3g} ({bounds}): {'holds' if low <= value <= high else 'FAILS'}"
