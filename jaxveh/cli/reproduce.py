"""`jaxveh reproduce NAME`: a paper's tables, as printed and honestly, and the checks."""

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
    _print_figures(_tyre_figures(found, out), out)
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


def mass_grade_aukf(
    seeds: Annotated[int, typer.Option("--seeds", help="How many drives of each kind, at least 2.", min=2)] = 20,
    seed: options.Seed = 0,
    numbers: options.Numbers = None,
    out: options.Out = None,
) -> None:
    """Mass and road grade at small acceleration, by adaptive unscented Kalman filter.

    The printed filter (its eq 25 freezes the mass), the repaired one, and what beats both: a grade whose rate walks, an
    accelerometer. A truck and a car of seven degrees of freedom are the truth. Some minutes for 20 seeds on two cores.

    Example: [bold]jaxveh reproduce mass-grade-aukf --seeds 20 --json mass_grade.json --out report/[/]
    """
    from jaxveh.experiments import mass_grade_aukf as experiment

    check_report(out, numbers)
    with progress("reproduce") as report:
        found = experiment.run(seeds=seeds, seed=seed, progress=report)
    tables, checks = experiment.tables(found), experiment.check(found)
    for one in tables:
        table(one.title, one.columns, one.rows)
    _print_checks(checks)
    _print_figures(_mass_figures(found, out), out)
    shown = {
        "checks": [check._asdict() for check in checks],
        "tables": [one._asdict() for one in tables],
        "observability": {name: _bounds(seen) for name, seen in found.observed.items()},
    }
    studies = {"truck": dataclasses.asdict(found.truck.study), "car": dataclasses.asdict(found.car.study)}
    write_numbers(numbers, shown, {"seeds": seeds, **studies}, seed)


def _print_figures(paths, out) -> None:
    """Draw the figures and say where they are; nothing without a folder."""
    if out is None:
        return
    make_folder(out)
    for path in paths:
        results().print(f"figure: {path}")


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


def _mass_figures(found, out):
    from jaxveh import plots
    from jaxveh.experiments.mass_grade_aukf import figures

    for raced in (found.truck, found.car):
        name = raced.study.name
        yield plots.save(figures.mass_figure(raced), out / f"{name}_mass.png")
        yield plots.save(figures.grade_figure(raced), out / f"{name}_grade.png")
    yield plots.save(figures.activity_figure(found.truck), out / "pedals.png")


def _tyre_figures(found, out):
    from jaxveh import plots
    from jaxveh.experiments.tyre_apf import figures

    yield plots.save(figures.curves_figure(found.outcome, found.study), out / "force_curves.png")
    yield plots.save(figures.parameters_figure(found.outcome, found.study), out / "parameters.png")
