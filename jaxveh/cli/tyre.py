"""`jaxveh tyre`: show the contents of tyre property files, and evaluate them for tables of inputs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import typer

from jaxveh import InputError, io, tyres
from jaxveh.cli import options
from jaxveh.cli.console import messages, number, printable, results, table
from jaxveh.cli.output import check_product, check_report, make_folder, write_numbers
from jaxveh.tyres import kit

TYRE = typer.Argument(metavar="FILE", help="A tyre property file (.tir).", show_default=False)
PRODUCT = typer.Option("-o", metavar="FILE", help="The outputs: .csv.", show_default=False)
LOADS = (0.5, 1.0, 1.5)
"""Loads in the table of `show`, relative to the nominal load."""


class Axes(StrEnum):
    """The sign convention of slip angle and cornering stiffness."""

    iso_w = "iso-w"
    ours = "ours"


def show(file: Annotated[Path, TYRE], out: options.Out = None, numbers: options.Numbers = None) -> None:
    """Show the contents of a tyre property file: version, ranges, the tyre at 0.5, 1 and 1.5 times the nominal load, findings.

    --out draws forces over slip, the friction ellipse, and the slips at which each coefficient affects the forces.

    Example: [bold]jaxveh tyre show tyre.tir --out figures[/]
    """
    check_report(out, numbers)
    source = io.read_property_file(file)
    tyre = tyres.from_property_file(source)
    s, r = tyre.structure, tyre.ranges
    head = (
        f"{file}: MF-Tyre {tyre.version / 10:g}, side {source.text('TYRESIDE', 'not given')}, "
        f"radius {float(s.UNLOADED_RADIUS):g} m, "
        f"nominal load {float(s.FNOMIN):g} N, pressure {float(s.NOMPRES) / 1e5:g} bar, measured at {float(s.LONGVL):g} m/s"
    )
    results().print(printable(head), markup=False)
    ranges = {
        "slip ratio, -": (r.KPUMIN, r.KPUMAX, 1.0),
        "slip angle, degrees": (r.ALPMIN, r.ALPMAX, 180 / np.pi),
        "camber, degrees": (r.CAMMIN, r.CAMMAX, 180 / np.pi),
        "load, N": (r.FZMIN, r.FZMAX, 1.0),
    }
    rows = [(name, number(float(low) * unit), number(float(high) * unit)) for name, (low, high, unit) in ranges.items()]
    table("Measured ranges", ("quantity", "from", "to"), rows)
    found = _free_rolling(tyre, jnp.asarray(LOADS, s.FNOMIN.dtype) * s.FNOMIN)
    quantities = {
        "friction along, -": "mu_x", "friction across, -": "mu_y", "slip stiffness, N": "K_xk",
        "cornering stiffness, N/rad": "K_ya", "relaxation along, m": "sigma_x", "relaxation across, m": "sigma_y",
        "trail, m": "trail", "effective radius, m": "R_e", "deflection, m": "rho",
    }  # fmt: skip
    rows = [(name, *map(number, found[field])) for name, field in quantities.items()]
    table("Free rolling, at loads in N", ("quantity", *[f"{share * float(s.FNOMIN):g}" for share in LOADS]), rows)
    findings = tyres.check_property_file(source)
    if findings:
        table("Findings about the file", ("about", "finding"), findings, left=2)
    shown: dict[str, Any] = {
        "version": tyre.version,
        "loads": [share * float(s.FNOMIN) for share in LOADS],
        **{field: found[field] for field in quantities.values()},
        "findings": [finding._asdict() for finding in findings],
    }
    if out is not None:
        _draw(tyre, out)
    write_numbers(numbers, shown, {"file": file}, 0)


def _free_rolling(tyre: tyres.MFTyre, load: jax.Array) -> dict[str, list[float]]:
    """Return all outputs at these loads, by name."""
    found = _outputs(tyre, tyres.Contact(load=load))
    return {name: np.broadcast_to(value, load.shape).tolist() for name, value in found._asdict().items()}


@eqx.filter_jit
def _outputs(tyre: tyres.MFTyre, at: tyres.Contact) -> Any:
    return tyre.outputs(at)


def _draw(tyre: tyres.MFTyre, out: Path) -> None:
    from jaxveh import plots

    make_folder(out)
    nominal = float(tyre.structure.FNOMIN)
    figures = {
        "tyre": plots.tyre(tyre, [share * nominal for share in LOADS]),
        "friction_ellipse": plots.friction_ellipse(tyre, nominal),
        "gradients": plots.gradient_map(tyre, nominal, _coefficients),
    }
    for name, figure in figures.items():
        results().print(f"figure: {plots.save(figure, out / f'{name}.png')}")


def _coefficients(tyre: tyres.MFTyre) -> tuple:
    """Return the coefficients of stiffness, friction and combined slip for the longitudinal and the lateral force."""
    along, across = tyre.longitudinal, tyre.lateral
    return along.PKX1, across.PKY1, along.PDX1, across.PDY1, along.RBX1, across.RBY1


def evaluate_table(
    file: Annotated[Path, TYRE],
    inputs: Annotated[Path, typer.Argument(metavar="INPUTS", help="A table of inputs: .csv.", show_default=False)],
    product: Annotated[Path, PRODUCT],
    axes: Annotated[Axes, typer.Option("--axes", help="Signs of slip angle and cornering stiffness.")] = Axes.iso_w,
    force: options.Force = False,
) -> None:
    """Evaluate a tyre for each row of a table, whose columns are found by name.

    Columns: in_Fz, in_kappa, in_alpha, in_gamma, in_Vx, in_P (or without in_) in N, -, rad, rad, m/s, Pa, and optionally
    useMode (111, 121, 211, 221). With --axes iso-w a positive slip angle gives a negative force, with --axes ours a
    positive one. Outputs have the names of the reference evaluator.

    Example: [bold]jaxveh tyre evaluate tyre.tir inputs.csv -o outputs.csv --axes iso-w[/]
    """
    check_product(product, (".csv",), force, (file, inputs))
    tyre = tyres.from_property_file(io.read_property_file(file))
    frame = _read(inputs)
    found = kit.evaluate(tyre, {name: frame[name].to_numpy() for name in frame if _is_wanted(name)}, axes=axes.value)
    _say_what_is_beyond(tyre, found)
    import pandas as pd

    with io.replacing_file(product, overwrite=force) as part:
        pd.DataFrame(found).to_csv(part, index=False)
    results().print(f"{product}: {len(frame)} rows, {', '.join(found)}")


def _is_wanted(name: str) -> bool:
    return name == "useMode" or any(name in names for names in kit.EVALUATION_INPUTS.values())


def _read(path: Path) -> Any:
    import pandas as pd

    io.check_readable(path)
    try:
        frame = pd.read_csv(path)
        # Read again as cells, since pandas renames the second column of a name.
        names = pd.read_csv(path, header=None, nrows=1, dtype=str).iloc[0].tolist()
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is not a CSV table ({error}).") from None
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1 and _is_wanted(name)]:
        raise InputError(f"{path}: several columns are named {', '.join(map(repr, twice))}; rename them.")
    for name in filter(_is_wanted, frame):
        if not pd.api.types.is_numeric_dtype(frame[name]):
            bad = pd.to_numeric(frame[name], errors="coerce").isna().to_numpy().argmax()
            raise InputError(f"{path}: {name} = {frame[name].iloc[bad]!r} in row {bad}: must be a number.")
    return frame


def _say_what_is_beyond(tyre: tyres.MFTyre, found: dict[str, np.ndarray]) -> None:
    """Warn of rows beyond the measured range; the model, like the reference evaluator, limits their inputs to the range."""
    r = tyre.ranges
    for name, low, high in (
        ("kappa", r.KPUMIN, r.KPUMAX), ("alpha", r.ALPMIN, r.ALPMAX), ("gamma", r.CAMMIN, r.CAMMAX), ("Fz", r.FZMIN, r.FZMAX),
        ("P", r.PRESMIN, r.PRESMAX),
    ):  # fmt: skip
        beyond = int(np.sum((found[name] < float(low)) | (found[name] > float(high))))
        if beyond:
            messages().print(
                f"warning: {name} is beyond the tyre's range, {float(low):g} to {float(high):g}, in {beyond} rows",
                soft_wrap=True,
            )
