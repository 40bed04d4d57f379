"""`jaxveh reproduce NAME`: the tables of a paper, as printed and with fair settings, and its criteria."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from jaxveh._core.errors import InputError, check_one_of
from jaxveh._core.progress import Progress
from jaxveh.cli import options
from jaxveh.cli.all_papers import all_papers
from jaxveh.cli.console import number, progress, results, table
from jaxveh.cli.output import check_report, make_folder, write_numbers
from jaxveh.cli.stores import Processes, Scheduler, Store, stores_of

if TYPE_CHECKING:
    from jaxveh import experiments
    from jaxveh.sweeps import Stores

PAPERS = {
    "tyre-apf": "Magic Formula parameters by auxiliary particle filter (Bao, Sabbioni et al. 2015)",
    "model-adaptive-pf": "sideslip by a particle filter with noise levels from wavelets (Qin et al. 2014)",
    "federated-ckf": "states, friction and mass of an electric car by federated cubature Kalman filters (Ji, Li, Fan)",
    "sideslip-review": "the catalogue of sideslip estimation, its circles and crosses as numbers (Chen, Gao, Xu 2013)",
    "mass-grade-aukf": "mass and road grade at small acceleration by adaptive unscented Kalman filter",
}
"""The papers by name: the module is `jaxveh.experiments.` plus the name with underscores."""

ALL = "all"

LOGGED = "sideslip-review"
"""The paper whose methods can also be judged on a real log."""

LOG = typer.Option("--log", help=f"{LOGGED}: a log with steer, v_x, a_x, a_y, yaw_rate, and v_y to score against.")
CAR = typer.Option("--vehicle", help="The car of the log (see `jaxveh schema car`).")

NAME = typer.Argument(
    metavar="NAME",
    help="; ".join(f"[bold]{name}[/]: {what}" for name, what in PAPERS.items()) + f"; or [bold]{ALL}[/].",
)


def reproduce(
    name: Annotated[str, NAME],
    seeds: Annotated[
        int | None,
        typer.Option(
            "--seeds", help="Number of seeds, at least 2. Default: as many as the paper's criteria need.", min=2
        ),
    ] = None,
    seed: options.Seed = 0,
    as_printed: Annotated[
        bool,
        typer.Option("--as-printed", help="Only the paper's printed settings, errata included, and their results."),
    ] = False,
    log: Annotated[Path | None, LOG] = None,
    car: Annotated[Path | None, CAR] = None,
    store: Store = None,
    processes: Processes = None,
    scheduler: Scheduler = None,
    numbers: options.Numbers = None,
    out: options.Out = None,
) -> None:
    """Reproduce a paper: its tables, as printed and with fair settings, and criteria that are met, failed or open.

    Every table has the do-nothing baseline, and medians and quartiles over seeds; each criterion says who was told what of the
    truth. Only the original criteria are counted; a substitute stands beside its original. Each paper takes some minutes on
    two cores.
    --out draws the figures of a paper, --json writes every number and each criterion. With --store a run over thousands of
    seeds can be killed and continued. With [bold]all[/] each paper has a folder of its name in those of --store and --out.

    Example: [bold]jaxveh reproduce mass-grade-aukf --json mass_grade.json --out report/[/]

    Example: [bold]jaxveh reproduce federated-ckf --seeds 1000 --store federated/ --processes 8[/]
    """
    check_one_of("NAME", name, (*PAPERS, ALL))
    check_report(out, numbers)
    _check_log(name, log, car, as_printed)
    stores = stores_of(store, processes, scheduler)
    if name == ALL:
        asked = {"--seeds": seeds, "--seed": seed, "--as-printed": as_printed or None, "--out": out, "--store": store}
        asked |= {"--processes": processes, "--scheduler": scheduler}
        more = {"--log": log, "--vehicle": car}
        all_papers(
            {name: asked | (more if name == LOGGED else {}) for name in PAPERS},
            numbers,
            # One paper at a time, so that it has the processes to itself.
            at_once=None if processes is None else 1,
        )
        return
    asked = (
        {"seed": seed} | ({} if seeds is None else {"seeds": seeds}) | ({} if log is None else {"log": log, "car": car})
    )
    with progress("reproduce") as report:
        found = _one(name, asked, as_printed, report, out, stores)
    write_numbers(numbers, found, found.pop("settings"), seed)


def _check_log(name: str, log: Path | None, car: Path | None, as_printed: bool) -> None:
    """Raise `InputError` if a log is given without its car, or for a paper that does not use a log."""
    if (log is None) != (car is None):
        raise InputError("--log and --vehicle belong together: give both, or neither.")
    if log is not None and name not in (LOGGED, ALL):
        raise InputError(f"--log: only {LOGGED} uses a log; leave it out, or reproduce that paper.")
    if log is not None and as_printed:
        raise InputError("--log: --as-printed uses no log; leave out --log or --as-printed.")


def _one(
    name: str, asked: dict[str, Any], as_printed: bool, report: Progress, out: Path | None, stores: Stores | None
) -> dict[str, Any]:
    """Run one paper with the options `asked`, print its results, and return them for the JSON file."""
    from jaxveh import experiments

    _every_core()
    experiment = _experiment(name)
    where = {} if stores is None else {"stores": stores}
    if as_printed:
        tables, checks, settings = experiment.as_printed(**asked, **where, progress=report), [], asked
    else:
        found = experiment.run(**asked, **where, progress=report)
        tables, checks = experiment.tables(found), experiment.check(found)
        settings = {"seeds": found.seeds, **experiment.settings(found)}
    for one in tables:
        table(one.title, one.columns, one.rows)
    if checks:
        _show_checks(name, checks)
    if out is not None and not as_printed:
        _draw(experiment, found, out)
    return {
        "checks": [check._asdict() for check in checks],
        "tally": experiments.report.tally(checks)._asdict(),
        "tables": [one._asdict() for one in tables],
        "settings": settings,
    }


def _show_checks(name: str, checks: Sequence[experiments.report.Check]) -> None:
    """Print the criteria with value, bound and the number of their condition, and the conditions below the table.

    Below each original criterion stand its substitutes, which are not counted.
    """
    from jaxveh import experiments

    notes = {condition: i for i, condition in enumerate(dict.fromkeys(c.condition for c in checks), 1)}
    rows = [
        (c.status.upper() if not c.holds else c.status, "  beside it: " + c.name if c.original else c.name,
         number(c.value), number(c.bound), str(notes[c.condition]))
        for c in checks
    ]  # fmt: skip
    table(f"{name}: criteria", ("status", "criterion", "value", "bound", "where"), rows, left=2)
    for condition, i in notes.items():
        results().print(f"where {i}: {condition}", markup=False)
    results().print(f"original criteria that hold: {experiments.report.tally(checks)}")


def _draw(experiment: ModuleType, found: Any, out: Path) -> None:
    """Draw the figures and print their paths."""
    from jaxveh import plots

    make_folder(out)
    figures = importlib.import_module(f"{experiment.__name__}.figures")
    for stem, figure in figures.figures(found).items():
        results().print(f"figure: {plots.save(figure, out / f'{stem}.png')}")


def _experiment(name: str) -> ModuleType:
    return importlib.import_module(f"jaxveh.experiments.{name.replace('-', '_')}")


def _every_core() -> None:
    """Let sweeps use all cores of the machine, unless jax has started already, or the environment sets the number of devices."""
    import jax

    if "JAX_NUM_CPU_DEVICES" in os.environ or "xla_force_host_platform" in os.environ.get("XLA_FLAGS", ""):
        return
    try:
        jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    except RuntimeError:  # jax has made its devices already: their number stays
        return
