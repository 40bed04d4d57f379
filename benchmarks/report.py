"""The measurements as numbers for JSON and as a printed table."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Sequence

from .measure import Bound, Case, Samples, Skipped, Spread

__all__ = ["case_report", "render"]

_SCALES = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}


def case_report(
    case: Case, samples: Sequence[Samples], skipped: Sequence[Skipped], *, smoke: bool = False
) -> dict[str, object]:
    """Return all numbers of one case; ratios are taken within each round, and their spread over the rounds."""
    scale = _SCALES[case.unit.split()[0]]
    by_name = {s.contestant.name: s for s in samples}
    base = by_name.get(case.base)
    bounds = () if smoke else case.bounds  # tiny sizes have no meaning for speed
    contestants = []
    for s in samples:
        contestants.append(
            {
                "name": s.contestant.name,
                "note": s.contestant.note,
                "time": dataclasses.asdict(Spread.of([t / scale for t in s.times])),
                "wall": dataclasses.asdict(Spread.of([t / scale for t in s.wall])),
                "ratio": dataclasses.asdict(Spread.of(_ratios(s, [base]))) if base else None,
                "samples": [t / scale for t in s.times],
                "calls_per_sample": s.repeats,
            }
        )
    return {
        "case": case.name,
        "title": case.title,
        "unit": case.unit,
        "base": case.base if base else None,
        "contestants": contestants,
        "skipped": [dataclasses.asdict(s) for s in skipped],
        "checks": [c for bound in bounds if (c := _check(case, bound, by_name))],
    }


def _ratios(sample: Samples, references: Sequence[Samples]) -> list[float]:
    """Return the time in each round over that of the reference with the lowest median."""
    best = min(references, key=lambda r: Spread.of(r.times).median)
    return [t / b for t, b in zip(sample.times, best.times, strict=True)]


def _check(case: Case, bound: Bound, by_name: dict[str, Samples]) -> dict[str, object] | None:
    references = [by_name[name] for name in bound.references if name in by_name]
    if bound.contestant not in by_name or not references:
        return None
    ratio = Spread.of(_ratios(by_name[bound.contestant], references))
    against = min(references, key=lambda r: Spread.of(r.times).median).contestant.name
    return {
        "name": f"{case.name}: {bound.contestant} over {against}",
        "value": ratio.median,
        "quartiles": [ratio.lower, ratio.upper],
        "bound": bound.limit,
        "holds": ratio.median <= bound.limit,
    }


def render(report: dict[str, object]) -> None:
    """Print one case: a rich table if rich is installed, otherwise plain text."""
    head = ["", report["unit"], "quartiles", f"over {report['base']}" if report["base"] else "", "quartiles"]
    rows = [_row(c) for c in report["contestants"]]
    rows += [[s["name"], "skipped", s["reason"], "", ""] for s in report["skipped"]]
    if importlib.util.find_spec("rich"):
        _render_rich(report["title"], head, rows)
    else:
        _render_plain(report["title"], head, rows)
    for check in report["checks"]:
        verdict = "holds" if check["holds"] else "DOES NOT HOLD"
        print(f"  {check['name']}: {check['value']:.2f} <= {check['bound']:g} {verdict}")
    print()


def _row(contestant: dict) -> list[str]:
    time, ratio = contestant["time"], contestant["ratio"]
    row = [contestant["name"], _digits(time["median"]), f"{_digits(time['lower'])} - {_digits(time['upper'])}"]
    if ratio is None:
        return [*row, "", ""]
    return [*row, f"{ratio['median']:.2f}", f"{ratio['lower']:.2f} - {ratio['upper']:.2f}"]


def _digits(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:,.0f}"


def _render_rich(title: str, head: list[str], rows: list[list[str]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for i, name in enumerate(head):
        table.add_column(name, justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def _render_plain(title: str, head: list[str], rows: list[list[str]]) -> None:
    print(title)
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    for row in [head, *rows]:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        print("  " + "  ".join(cells).rstrip())
