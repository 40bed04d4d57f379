"""The options of `jaxveh estimate` that select quantities and methods, and the list of both."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Collection, Sequence
from pathlib import Path
from types import ModuleType
from typing import Annotated

import typer

from jaxveh import InputError, estimators
from jaxveh._core.errors import check_one_of
from jaxveh.cli.console import results, table
from jaxveh.io import CarSpecification

QUANTITIES: dict[str, ModuleType] = {
    name: getattr(estimators, name)
    for name in estimators.__all__
    if isinstance(getattr(estimators, name), ModuleType) and hasattr(getattr(estimators, name), "METHODS")
}
"""The modules of the quantities, by the name that `--what` takes."""

USUAL_FILTER, USUAL_PARTICLES = "ekf", 1000
"""Defaults of the sideslip program; the methods of the other quantities choose their own filters."""

ALL = "all"
"""In `--what`: each quantity that the log has channels for, by its recommended method; in `--methods`: all methods."""

FILLED = ("steer", "steer_rear", "steer_rl", "steer_rr", "v_x", "a_x")
"""Channels that `--fill` fills for every quantity; for a method also those that it needs in every row."""

RATIOS = ("rear_steer_ratio", "rear_steer_ratio_fast", "rear_steer_speed")
"""Keys of a car whose rear wheels are steered in a ratio to the front wheels."""

SATELLITES = ("speed", "course", "climb_rate", "heading")
"""The channels of a satellite receiver."""

OF_DEVICES = {
    "antenna_position": SATELLITES,
    "satellite_delay": SATELLITES,
    "camera_delay": ("lane_offset", "lane_heading"),
}
"""Keys of devices that a log may not have, and their channels."""


def inputs_of(what: Sequence[str], methods: Sequence[str] | None, car: CarSpecification) -> tuple[str, ...]:
    """Return the channels that `--fill` fills for these methods of quantities; None for the recommended ones."""
    found = set(FILLED)
    for quantity in (QUANTITIES[name] for name in what):
        for name in methods or (quantity.RECOMMENDED,):
            with contextlib.suppress(InputError):  # a car without a method's numbers is told of by the method
                found |= {need.channel for need in quantity.METHODS[name].make(car).needs if need.throughout}
    return tuple(sorted(found))


def tell_assumed(
    what: Sequence[str],
    methods: Sequence[str] | None,
    file: Path | None,
    car: CarSpecification,
    channels: Collection[str],
) -> None:
    """Print which keys a car's `file` lacks that these methods of quantities would use with these `channels` of the logs. Keys
    without which a method is refused are told of by the method."""
    missing = [
        entry.name
        for entry in dataclasses.fields(car)
        if getattr(car, entry.name) is None
        # Without a ratio the rear wheels are straight, and nothing is assumed.
        and (entry.name not in RATIOS or (entry.name == RATIOS[-1] and car.rear_steer_ratio_fast is not None))
        and (entry.name not in OF_DEVICES or {*OF_DEVICES[entry.name]} & {*channels})
    ]
    used: set[str] = set()
    for quantity in (QUANTITIES[name] for name in what):
        for method in (quantity.METHODS[name] for name in methods or (quantity.RECOMMENDED,)):
            used |= {*estimators.kit.keys_used(method, missing)} - {*estimators.kit.keys_asked(method)}
    keys = ", ".join(key for key in missing if key in used)
    if keys:
        assumed = f"note: {file} has no {keys}: usual values stand for them (jaxveh schema car explains the keys)."
        results().print(assumed, markup=False, soft_wrap=True)


def names_of(text: str, option: str, known: Sequence[str]) -> tuple[str, ...]:
    """Split an option's value at commas into names without repetition; `all` stands for all known names.

    **Raises** `InputError` for an unknown name.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        check_one_of(option, name, (*known, ALL))
    return tuple(known) if ALL in names else names


def methods_of(text: str | None, what: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return the methods of `--methods`; None for the recommended ones.

    **Raises** `InputError` for several quantities, or for a name that is no method of the quantity.
    """
    if text is None:
        return None
    quantity, *others = what
    if others:
        raise InputError(f"--methods applies to one quantity: name one with --what, not {', '.join(what)}.")
    return names_of(text, f"--methods of {quantity}", tuple(QUANTITIES[quantity].METHODS))


What = Annotated[
    str,
    typer.Option(
        "--what",
        metavar="QUANTITY",
        help="What to estimate. sideslip without --methods is calibrated and smoothed, and takes all options here. Otherwise: "
        f"quantities by their methods, separated by commas: {', '.join(QUANTITIES)}; all: every one that the log allows.",
    ),
]


def print_methods(wanted: bool) -> None:
    """Print the methods of each quantity and end the program, if that is `wanted`."""
    if not wanted:
        return
    for name, module in QUANTITIES.items():
        mark = lambda method, module=module: " *" if method == module.RECOMMENDED else ""
        rows = [(method + mark(method), one.help, one.source) for method, one in module.METHODS.items()]
        shown = ", ".join(f"{field} [{unit}]" for field, unit in module.SHOWN.items())
        table(f"--what {name}: {shown}", ("method (* recommended)", "description", "source"), rows, left=3)
    raise typer.Exit


Methods = Annotated[
    str | None,
    typer.Option(
        "--methods",
        metavar="NAMES",
        show_default=False,
        help="Methods to run side by side, separated by commas, or all (--list shows them).",
    ),
]

Live = Annotated[
    bool,
    typer.Option(
        "--live",
        help="Estimate each row from the rows up to it, as in a car. By default each row is estimated from all rows, if the "
        "method can be smoothed.",
    ),
]

Listed = Annotated[
    bool,
    typer.Option("--list", help="Print the methods of each quantity, and stop.", is_eager=True, callback=print_methods),
]
