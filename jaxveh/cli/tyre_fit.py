"""`jaxveh tyre fit`: fit a tyre to rig data."""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import equinox as eqx
import typer

from jaxveh import InputError, fitting, io, tyres
from jaxveh._core.errors import check_one_of
from jaxveh.cli import options, tyre_fit_report
from jaxveh.cli.console import progress, results
from jaxveh.cli.failure import say
from jaxveh.cli.output import check_product, check_report, make_folder, write_numbers
from jaxveh.fitting import kit as fitting_kit
from jaxveh.io import kit as io_kit

DEFAULT = "mf61"
SHAPE_OF_BOUNDS, SHAPE_OF_WEIGHT = "NAME=LOW:HIGH, such as PCY1=1:2", "CHANNEL=NUMBER, such as F_x=2"


class Axes(StrEnum):
    """The sign convention of rig data."""

    sae = "sae"
    adapted_sae = "adapted-sae"
    iso_w = "iso-w"
    ours = "ours"


class Side(StrEnum):
    """The side of the car on which the tyre was measured."""

    left = "left"
    right = "right"


DATA = typer.Argument(
    metavar="DATA",
    show_default=False,
    help="Rig data: .csv, the FSAE TTC's files (.dat, .txt, .csv, .mat) or TYDEX (.tdx, .tyd, .tydex); each file is a run.",
)
PRODUCT = typer.Option(
    "-o", metavar="FILE", show_default=False, help="The tyre file: .tir for MF-Tyre, .toml for other laws."
)
MODEL = typer.Option(
    "--model",
    metavar="LAW",
    help=f"The tyre law, with start values from the data: {', '.join(fitting_kit.RIG_STARTS)} ({DEFAULT} by default).",
)
START = typer.Option(
    "--start",
    metavar="FILE",
    help="Start from this tyre instead of --model: a property file (.tir), whose comments, units and coefficients that are not "
    "fitted are copied to -o, or a parameter file (.toml) that this program wrote.",
)
AXES = typer.Option(
    "--axes",
    show_default=False,
    help="Signs of the data. sae: z down, FZ negative, a positive slip angle gives a negative force; adapted-sae: z down, load "
    "and that force positive (the book's); iso-w: z up, that force negative; ours: z up, that force positive. By default iso-w, "
    "and sae for the FSAE TTC's files.",
)
CHANNELS = typer.Option(
    "--measured",
    metavar="F_x,F_y,...",
    help=f"Fit only these channels of {', '.join(io_kit.RIG_CHANNELS)}; by default all that the data have.",
)
BOUNDS = typer.Option("--bounds", metavar="NAME=LOW:HIGH", help="Keep a coefficient within these bounds; repeatable.")
WEIGHT = typer.Option(
    "--weight", metavar="CHANNEL=NUMBER", help="Multiply a channel's weight, which its noise sets, by this; repeatable."
)
FREE = typer.Option(
    "--free",
    metavar="NAME",
    help="Also fit a coefficient that is held by default: PKY4, the form of the cornering stiffness over load; repeatable.",
)
ROBUST = typer.Option(
    "--robust",
    help="For data with outliers: residuals follow Student's t with 4 degrees of freedom, with a scale from their median size.",
)
FOLDS = typer.Option(
    "--folds",
    metavar="N",
    min=0,
    help="Cross-validate: N times, leave out a part of the data, fit the rest, score that part.",
)
SIDE = typer.Option("--side", help="TYRESIDE of a new .tir file; a --start file has its own.")


@dataclasses.dataclass(frozen=True)
class Origin:
    """The start of a fit: the name of a `model`, or the `tyre` of --start and the property `file` that it came from."""

    model: str | None = None
    tyre: tyres.AbstractTyre | None = None
    file: io.PropertyFile | None = None

    @property
    def is_mf_tyre(self) -> bool:
        """Whether the product is a property file."""
        return isinstance(self.tyre, tyres.MFTyre) if self.model is None else self.model in ("mf61", "mf52", "mf62")


def fit_table(
    data: Annotated[list[Path], DATA],
    product: Annotated[Path, PRODUCT],
    model: Annotated[str | None, MODEL] = None,
    start: Annotated[Path | None, START] = None,
    axes: Annotated[Axes | None, AXES] = None,
    measured: Annotated[str | None, CHANNELS] = None,
    free: Annotated[list[str] | None, FREE] = None,
    bounds: Annotated[list[str] | None, BOUNDS] = None,
    weight: Annotated[list[str] | None, WEIGHT] = None,
    robust: Annotated[bool, ROBUST] = False,
    folds: Annotated[int, FOLDS] = 0,
    side: Annotated[Side | None, SIDE] = None,
    numbers: options.Numbers = None,
    out: options.Out = None,
    force: options.Force = False,
) -> None:
    """Fit a tyre to rig data, and write it as a property file (MF-Tyre) or a parameter file (other laws).

    CSV: columns Fz, alpha, kappa, gamma, Vx, P and the measurements Fx, Fy, Mx, My, Mz, in SI units and radians, or with the
    unit in the name, such as alpha \\[deg]; Fz, a slip and a measurement are needed. A column run numbers sweeps for --folds.
    Files of the Formula SAE Tire Test Consortium are read unchanged: SA, SL, IA, FZ, ..., metric or US units by their line of
    units, in SAE's axes. Slopes that no tyre has (F_y over slip angle and camber, F_x over slip ratio, M_z over slip angle)
    show that the data have other axes: such data are refused, or, with --start, which defines the tyre, a warning is printed.

    MF-Tyre is fitted in stages over the coefficients that the data excite, then over all of them together; each coefficient has
    a standard error. Coefficients that the data do not identify keep their start values. If several sets of signs (of RBY2, say)
    give the same tyre, one form is written. --out draws residuals over slip and load. If residuals have heavier tails than
    noise, try --robust.

    Example: [bold]jaxveh tyre fit lateral.csv braking.csv --model mf61 --side left --folds 5 --out figures -o tyre.tir[/]

    Example: [bold]jaxveh tyre fit run23.mat run24.dat --robust -o tyre.tir[/]
    """
    origin = _origin(model, start)
    check_product(product, (".tir",) if origin.is_mf_tyre else (".toml",), force, (*data, start))
    check_report(out, numbers)
    _check_side(side, origin)
    chosen = _channels(measured)
    limits, weights = _bounds(bounds), _weights(weight)
    rig = io.read_rig_table(data, None if axes is None else axes.value, measured=chosen or io_kit.RIG_CHANNELS)
    law = _law(origin, rig)
    with progress("fit") as report:
        fit = fitting.fit_rig(
            law, rig, free=[_full_name(law, name) for name in free or ()], measured=chosen, weights=weights,
            bounds={_full_name(law, name): ends for name, ends in limits.items()},
            robust=robust, folds=folds, progress=report, throw=False,
        )  # fmt: skip
    note = f"Fitted to {', '.join(path.name for path in data)} by jaxveh tyre fit: {', '.join(fit.rmse)}."
    findings = _write(fit, rig, origin, side, note, product, force)
    shown = tyre_fit_report.show(fit, law, findings, robust)
    if out is not None:
        _draw(fit, rig, out)
    results().print(f"{product}: {type(fit.tyre).__name__} fitted to {fit.stages[-1].rows} rows of {rig.source}")
    configuration = {
        "data": data, "model": origin.model, "start": start, "axes": axes, "measured": chosen, "free": free, "bounds": limits,
        "weights": weights, "robust": robust, "folds": folds, "side": side,
    }  # fmt: skip
    write_numbers(numbers, {**shown, "file": product}, configuration, None)


def _origin(model: str | None, start: Path | None) -> Origin:
    if start is None:
        model = DEFAULT if model is None else model
        check_one_of("--model", model, tuple(fitting_kit.RIG_STARTS))
        return Origin(model)
    if model is not None:
        raise InputError(f"--model {model}: --start {start} defines the law; leave one of the two out.")
    if start.suffix.lower() == ".tir":
        file = io.read_property_file(start)
        return Origin(tyre=tyres.from_property_file(file), file=file)
    if start.suffix.lower() != ".toml":
        raise InputError(f"--start {start}: suffix {start.suffix!r}; it must end in one of .tir, .toml.")
    return Origin(tyre=tyres.read_parameters(start))


def _check_side(side: Side | None, origin: Origin) -> None:
    if side is not None and origin.file is not None:
        raise InputError(f"--side {side.value}: {origin.file.source} has its own side; leave --side out.")
    if side is not None and not origin.is_mf_tyre:
        raise InputError(f"--side {side.value}: only a property file (.tir) has a side; leave --side out.")


def _law(origin: Origin, rig: io.RigTable) -> tyres.AbstractTyre:
    """Return the tyre to start from; with --start warn of odd signs, and widen a property file's ranges to the data."""
    if origin.model is not None:
        return fitting.starting_tyre(origin.model, rig)
    for wrong in fitting.wrong_signs(rig):
        say("warning", "yellow", wrong.words)
    law = origin.tyre
    assert law is not None
    if isinstance(law, tyres.MFTyre):
        law, widened = fitting_kit.widened_ranges(law, rig)
        if widened:
            listed = ", ".join(f"{one.name} from {one.before:g} to {one.after:g}" for one in widened)
            say("warning", "yellow", f"ranges of --start are widened to contain the data: {listed}")
    return law


def _write(
    fit: fitting.RigFit, rig: io.RigTable, origin: Origin, side: Side | None, note: str, product: Path, force: bool
) -> list[tyres.PropertyFinding]:
    """Write the tyre; return the findings about a property file."""
    tyre = fit.tyre
    if not isinstance(tyre, tyres.MFTyre):
        tyres.write_parameters(tyre, product, note=note, overwrite=force)
        return []
    if origin.file is None:
        tyre = fitting_kit.measured_ranges(tyre, rig)
        note += "\nValues of an ordinary tyre, not fitted: radius, stiffness, contact patch, coefficients the data do not excite."
    file = tyres.to_property_file(tyre, like=origin.file, side=None if side is None else side.value, note=note)
    io.write_property_file(file, product, overwrite=force)
    return tyres.check_property_file(file)


def _draw(fit: fitting.RigFit, rig: io.RigTable, out: Path) -> None:
    from jaxveh import plots

    make_folder(out)
    for name in fit.rmse:
        path = plots.save(plots.rig_fit(fit, rig, [name]), out / f"rig_fit_{name}.png")
        results().print(f"figure: {path}")


def _channels(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    found = tuple(name.strip() for name in text.split(",") if name.strip())
    if not found:
        raise InputError(f"--measured {text!r}: must name at least one of {', '.join(io_kit.RIG_CHANNELS)}.")
    for name in found:
        check_one_of("--measured", name, io_kit.RIG_CHANNELS)
    return tuple(dict.fromkeys(found))


def _bounds(texts: list[str] | None) -> dict[str, tuple[float, float]]:
    found = {}
    for text in texts or ():
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        bounds = tuple(_number(end, "--bounds", text, SHAPE_OF_BOUNDS) for end in (low, high))
        if not bounds[0] < bounds[1]:
            raise InputError(f"--bounds {text}: {low} must be less than {high}.")
        found[name.strip()] = bounds
    return found


def _weights(texts: list[str] | None) -> dict[str, float]:
    found = {}
    for text in texts or ():
        name, _, value = text.partition("=")
        found[name.strip()] = _number(value, "--weight", text, SHAPE_OF_WEIGHT)
    return found


def _number(value: str, option: str, text: str, shape: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not abs(number) < float("inf"):
        raise InputError(f"{option} {text}: must be {shape}.")
    return number


def _full_name(law: tyres.AbstractTyre, name: str) -> str:
    """Return `lateral.PCY1` for `PCY1`, the name in property files; other names unchanged."""
    for section, part in vars(law).items():
        if isinstance(part, eqx.Module) and name in vars(part):
            return f"{section}.{name}"
    return name
