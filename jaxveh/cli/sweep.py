"""`jaxveh sweep STUDY.toml`: compute a study and store its numbers; `jaxveh sweep show`: its tables and figures."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from jaxveh import InputError, io
from jaxveh.cli import options
from jaxveh.cli.console import progress, results, table
from jaxveh.cli.output import check_report, make_folder, write_numbers
from jaxveh.cli.stores import Processes, Scheduler, check_workers

if TYPE_CHECKING:
    from jaxveh.sweeps import Swept

SUFFIX, ZARR = ".zarr", "zarr.json"
RUN = "run"

STUDY = typer.Argument(metavar="STUDY.toml", help="The study: what to vary (jaxveh schema study).", show_default=False)
STORE = typer.Option(
    "-o", metavar="STORE.zarr", help="The store of the numbers; an unfinished store is continued.", show_default=False
)
PART = typer.Option(
    "--part",
    metavar="I/N",
    help="Compute one share of the chunks, 0/8 to 7/8, for an array of jobs.",
    show_default=False,
)
BATCH = typer.Option(
    "--batch", metavar="RUNS", help="Runs per chunk; a chunk is computed at once.", min=1, show_default=False
)
VALUES = typer.Option("--value", metavar="NAME", help="Show only this value; repeatable.", show_default=False)
LIST = typer.Option("--list", help="Show estimators, filters and metrics, and stop.")


class RunUnlessNamed(TyperGroup):
    """A group whose command may be omitted: arguments without a command are those of `run`."""

    def parse_args(self, ctx, args):
        if args and args[0] not in self.commands and args[0] not in ctx.help_option_names:
            args = [RUN, *args]
        return super().parse_args(ctx, args)


def run(
    study: Annotated[Path | None, STUDY] = None,
    store: Annotated[Path | None, STORE] = None,
    processes: Processes = None,
    scheduler: Scheduler = None,
    part: Annotated[str | None, PART] = None,
    batch: Annotated[int | None, BATCH] = None,
    out: options.Out = None,
    numbers: options.Numbers = None,
    listed: Annotated[bool, LIST] = False,
) -> None:
    """Simulate, estimate and score every combination of the settings that a study varies, each with the same seeds.

    The store is a Zarr store, which xarray opens. Stored chunks are never computed again: a killed sweep continues when it is
    started again. A store of another study is refused, with the difference. Tables are printed at the end, and --out draws
    figures; [bold]jaxveh sweep show STORE.zarr[/] does both again.

    Begin with: [bold]jaxveh schema study > study.toml; jaxveh sweep study.toml -o study.zarr --processes 2 --out figures[/]
    """
    if listed:
        return _list()
    study, store = _check(study, store)
    share = _part(part)
    check_workers(processes, scheduler)
    if share is not None and (out, numbers) != (None, None):
        raise InputError(
            "--part: a share has no tables of its own; use --out and --json with jaxveh sweep show at the end."
        )
    check_report(out, numbers)
    from jaxveh import studies, sweeps

    told = studies.read_study(study)
    results().print(f"{told.size} runs: {told.words()}", markup=False)
    with progress("sweep") as report:
        report(0, 1, "compiling")
        found = sweeps.sweep(
            told, told.design, told.seeds, told.key, store=store, processes=processes, client=scheduler, part=share,
            batch=batch, units=told.units(), note=f"{told.words()}\n\n{study.read_text(encoding='utf-8-sig')}", progress=report,
        )  # fmt: skip
    if share is not None:
        results().print(
            f"{store}: the share {part} is done; when all shares are, jaxveh sweep show prints the tables", markup=False
        )
        return
    _tell(found, store, (), out, numbers, {"study": study, "store": store})


def show(
    store: Annotated[Path, typer.Argument(metavar="STORE.zarr", help="A sweep's store.", show_default=False)],
    values: Annotated[list[str] | None, VALUES] = None,
    out: options.Out = None,
    numbers: options.Numbers = None,
) -> None:
    """Print the tables of a sweep's store, and draw its figures with --out; the sweep may be of a study or from Python.

    The tables have medians and quartiles along each axis. Errors (rmse, worst, final, crps) are compared with doing nothing,
    and each choice with the first on the same drives; the choices are ranked.

    Example: [bold]jaxveh sweep show study.zarr --out figures --value rmse.sideslip[/]
    """
    check_report(out, numbers)
    from jaxveh import sweeps

    found = sweeps.read_sweep(store)
    if found.note:
        results().print(found.note.partition("\n\n")[0], markup=False)
    _tell(found, store, values or (), out, numbers, {"store": store, "values": values})


def _check(study: Path | None, store: Path | None) -> tuple[Path, Path]:
    """Return both paths; raise `InputError`, before any work, if one is missing or wrong."""
    if study is None:
        raise InputError("sweep: STUDY.toml is missing (jaxveh schema study prints one).")
    if store is None:
        raise InputError(
            "sweep: -o STORE.zarr is missing: the store of the numbers, from which a killed sweep continues."
        )
    if store.suffix.lower() != SUFFIX:
        raise InputError(f"-o {store}: suffix {store.suffix!r}; it must end in {SUFFIX}.")
    if store.exists() and not (store / ZARR).exists():
        what = f"a folder without {ZARR}" if store.is_dir() else "a file"
        raise InputError(f"-o {store}: is {what}, and no sweep's store; take another name, or remove it.")
    io.kit.require("zarr", "storing a sweep", "sweep")
    return study, store


def _part(text: str | None) -> tuple[int, int] | None:
    """Return I/N as numbers."""
    if text is None:
        return None
    share, slash, of = text.partition("/")
    if not (slash and share.isdecimal() and of.isdecimal() and int(share) < int(of)):
        raise InputError(f"--part {text}: must be I/N with I from 0 to N - 1, such as 0/8.")
    return int(share), int(of)


def _tell(
    found: Swept,
    store: Path,
    values: Iterable[str],
    out: Path | None,
    numbers: Path | None,
    configuration: dict[str, Any],
) -> None:
    """Print the tables, draw the figures, write the numbers."""
    from jaxveh import studies

    made = studies.tables(found, values)
    for one in made:
        table(one.title, one.columns, one.rows, left=one.left)
    results().print(f"{store}: {', '.join(found.values)}", markup=False)
    drawn = []
    if out is not None:
        from jaxveh import plots

        make_folder(out)
        for stem, figure in studies.figures.figures(found, values):
            drawn.append(plots.save(figure, out / f"{stem}.png"))
            results().print(f"figure: {drawn[-1]}", markup=False)
    shown = {
        "note": found.note,
        "units": dict(found.units),
        "tables": [one._asdict() for one in made],
        "figures": drawn,
    }
    write_numbers(numbers, shown, configuration, None)


def _list() -> None:
    """Print the names that a study can use, in addition to those of `jaxveh simulate --list`."""
    from jaxveh import studies
    from jaxveh.cli.vehicle import first_line

    rows = [(name, one.help, " ".join(one.options)) for name, one in studies.ESTIMATORS.items()]
    table("Estimators ([estimator] name)", ("name", "description", "further keys"), rows, left=3)
    rows = [(name, first_line(kind), " ".join(studies.filter_options(name))) for name, kind in studies.FILTERS.items()]
    table("Filters ([filter] name)", ("name", "description", "further keys"), rows, left=3)
    rows = [(f"{name}.QUANTITY" if one.of_quantity else name, one.help) for name, one in studies.METRICS.items()]
    table("Metrics ([metrics] names)", ("name", "description"), rows, left=2)
    results().print("Vehicles, fidelities, manoeuvres with their options, roads and devices: jaxveh simulate --list")
