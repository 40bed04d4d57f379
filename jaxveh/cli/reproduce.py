"""`jaxveh reproduce tyre-apf`: the paper's tables, as printed and honestly, and the checks."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import typer

from jaxveh.cli import options
from jaxveh.cli.console import number, progress, results, table
from jaxveh.cli.output import check_report, make_folder, write_numbers
from jaxveh.experiments import tyre_apf as experiment


def tyre_apf(
    seeds: Annotated[int, typer.Option("--seeds", help="How many, all in one batch.", min=1)] = 50,
    seed: options.Seed = 0,
    as_printed: Annotated[
        bool, typer.Option("--as-printed", help="Show only the tables made with the paper's printed settings.")
    ] = False,
    numbers: options.Numbers = None,
    out: options.Out = None,
) -> None:
    """Bao, Sabbioni et al. (2015): Magic Formula parameters by auxiliary particle filter.

    Tables 2 and 3 and the step-steer figures, with the printed settings and honestly (a prior that does not know the
    truth), and checks against the printed numbers. Several minutes for 50 seeds on two cores.

    Example: [bold]jaxveh reproduce tyre-apf --seeds 50 --json tyre_apf.json[/]
    """
    check_report(out, numbers)
    with progress("reproduce") as report:
        found = experiment.run(seeds=seeds, seed=seed, progress=report)
    tables, checks = experiment.tables(found), experiment.check(found)
    for one in tables:
        if not as_printed or "as printed" in one.title:
            table(one.title, one.columns, one.rows)
    _print_checks(checks)
    if out is not None:
        make_folder(out)
        for path in _figures(found, out):
            results().print(f"figure: {path}")
    shown = {
        "checks": [check._asdict() for check in checks],
        "tables": [one._asdict() for one in tables],
        "observability": {"lane_change": _bounds(found.lane_change), "sweep": _bounds(found.sweep)},
    }
    configuration = {
        "seeds": seeds,
        "study": dataclasses.asdict(found.study),
        "printed": dataclasses.asdict(found.printed_settings),
    }
    write_numbers(numbers, shown, configuration, seed)


def _print_checks(checks) -> None:
    rows = [("yes" if c.holds else "NO", c.name, number(c.value), number(c.bound)) for c in checks]
    table("Checks", ("holds", "criterion", "value", "bound"), rows)
    results().print(f"{sum(c.holds for c in checks)} of {len(checks)} hold")


def _bounds(report) -> dict:
    return {
        "condition_number": report.condition_number,
        "bounds": dict(zip(report.names, report.bounds, strict=True)),
        "report": report.report().splitlines(),
    }


def _figures(found, out):
    from jaxveh import plots
    from jaxveh.experiments.tyre_apf import figures

    yield plots.save(figures.curves_figure(found.outcome, found.study), out / "force_curves.png")
    yield plots.save(figures.parameters_figure(found.outcome, found.study), out / "parameters.png")
