"""The options of `jaxveh estimate` that name quantities and methods, and the list of both."""

from __future__ import annotations

from types import ModuleType
from typing import Annotated

import typer

from jaxveh import estimators
from jaxveh.cli.console import table

QUANTITIES: dict[str, ModuleType] = {
    name: getattr(estimators, name)
    for name in estimators.__all__
    if isinstance(getattr(estimators, name), ModuleType) and hasattr(getattr(estimators, name), "METHODS")
}
"""By the name that `--what` takes."""

USUAL_FILTER, USUAL_PARTICLES = "ekf", 1000
"""Of sideslip's own program; methods bring their filters with them."""

What = Annotated[
    str,
    typer.Option(
        "--what",
        metavar="QUANTITY",
        help="sideslip (calibrated and smoothed, with all options here), or by one of its methods each: "
        f"{', '.join(QUANTITIES)}; several with commas; all: whatever the log can tell.",
    ),
]


def print_methods(wanted: bool) -> None:
    """Print the methods of each quantity, and leave, where that is `wanted`."""
    if not wanted:
        return
    for name, module in QUANTITIES.items():
        mark = lambda method, module=module: " *" if method == module.RECOMMENDED else ""
        rows = [(method + mark(method), one.help, one.source) for method, one in module.METHODS.items()]
        shown = ", ".join(f"{field} [{unit}]" for field, unit in module.SHOWN.items())
        table(f"--what {name}: {shown}", ("method (* recommended)", "what it is", "from"), rows, left=3)
    raise typer.Exit


Methods = Annotated[
    str | None,
    typer.Option(
        "--methods",
        metavar="NAMES",
        show_default=False,
        help="Methods to run side by side, with commas, or all (--list shows them).",
    ),
]

Listed = Annotated[
    bool,
    typer.Option("--list", help="Print the methods of each quantity, and stop.", is_eager=True, callback=print_methods),
]
