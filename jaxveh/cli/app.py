"""The commands and their help."""

from __future__ import annotations

from typing import Annotated

import typer

import jaxveh
from jaxveh.cli.cache import clear
from jaxveh.cli.cache import show as show_cache
from jaxveh.cli.check import check
from jaxveh.cli.console import results
from jaxveh.cli.demo import demo
from jaxveh.cli.estimate import estimate
from jaxveh.cli.failure import join_lines, program
from jaxveh.cli.fit import fit
from jaxveh.cli.reproduce import reproduce
from jaxveh.cli.schema import schema
from jaxveh.cli.simulate import simulate
from jaxveh.cli.sweep import RUN, RunUnlessNamed
from jaxveh.cli.sweep import run as run_sweep
from jaxveh.cli.sweep import show as show_sweep
from jaxveh.cli.tyre import evaluate_table, show
from jaxveh.cli.tyre_fit import fit_table

HELP = """Estimate what a car cannot measure: sideslip and tyre parameters from steer, speed, acceleration and yaw rate.

Units are SI and radians unless an option says otherwise; axes are x forward, y left, z up; steer, yaw and yaw rate are
positive to the left. Times are in the time of the log.

--out DIR is the folder for figures, -o FILE the output file; --json FILE takes every number shown, with a manifest. Exit
codes: 0 done, 1 a filter or a fit failed, 2 bad input.

Start with: jaxveh demo
"""

app = typer.Typer(
    name="jaxveh",
    help=join_lines(HELP),
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

tyre = typer.Typer(help="Tyres: property files (.tir), and fits to rig data.", no_args_is_help=True)

cache = typer.Typer(help="The cache of compiled programs, kept between starts.", no_args_is_help=True)

sweep = typer.Typer(
    cls=RunUnlessNamed, no_args_is_help=True,
    help="Studies over many runs: STUDY.toml -o STORE.zarr (or run STUDY.toml ...) computes one, show STORE.zarr shows it.",
)  # fmt: skip


def _version(wanted: bool) -> None:
    if wanted:
        results().print(f"jaxveh {jaxveh.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Take the options that stand before the command."""


options.__doc__ = join_lines(HELP)

for command in (demo, check, simulate, estimate, fit, reproduce, schema):
    app.command()(program(command))
tyre.command("show")(program(show))
tyre.command("evaluate")(program(evaluate_table))
tyre.command("fit")(program(fit_table))
app.add_typer(tyre, name="tyre")
cache.command("show")(program(show_cache))
cache.command("clear")(program(clear))
app.add_typer(cache, name="cache")
sweep.command(RUN)(program(run_sweep))
sweep.command("show")(program(show_sweep))
app.add_typer(sweep, name="sweep")
