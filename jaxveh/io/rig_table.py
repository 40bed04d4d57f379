"""Rig data: what a tyre did on a test rig, row by row."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jaxveh._core.errors import InputError, check_one_of
from jaxveh.io.csv_log import read_columns
from jaxveh.io.files import check_readable, check_suffix
from jaxveh.io.log import numeric, split_unit
from jaxveh.io.tydex import read_tydex
from jaxveh.io.tydex_axes import contact_patch
from jaxveh.io.units import convert, given

AXES = ("iso-w", "ours")
INPUTS = ("slip_angle", "slip_ratio", "load", "camber", "speed", "pressure")
MEASURED = ("F_x", "F_y", "M_x", "M_y", "M_z")
TYDEX_SUFFIXES = (".tdx", ".tyd", ".tydex")

COLUMNS = {
    "slip_angle": (("in_alpha", "alpha", "slip_angle"), "rad"),
    "slip_ratio": (("in_kappa", "kappa", "slip_ratio"), "dimensionless"),
    "load": (("in_Fz", "Fz", "load"), "N"),
    "camber": (("in_gamma", "gamma", "camber"), "rad"),
    "speed": (("in_Vx", "Vx", "speed"), "m/s"),
    "pressure": (("in_P", "P", "pressure"), "Pa"),
    "F_x": (("Fx", "F_x"), "N"),
    "F_y": (("Fy", "F_y"), "N"),
    "M_x": (("Mx", "M_x"), "N*m"),
    "M_y": (("My", "M_y"), "N*m"),
    "M_z": (("Mz", "M_z"), "N*m"),
    "run": (("run",), "dimensionless"),
}
"""Names of a CSV file's columns, the first that is there counts, and the unit that is meant where a name carries none."""


@dataclass(frozen=True, eq=False)
class RigTable:
    """Measurements of a tyre; float arrays (n,) in SI units and this package's axes (x forward, y left, z up).

    Inputs: `slip_angle` (rad, a positive one gives a positive force), `slip_ratio` (-), `load` (N); `camber` (rad), `speed`
    (m/s) and `pressure` (Pa) are None where nobody told. Measured: `F_x`, `F_y` (N), `M_x`, `M_y`, `M_z` (N m) at the contact
    patch, None where the rig has none, NaN where a value is missing. `run` (n,) numbers the sweep that a row belongs to.

    **Raises** `InputError` for arrays of several lengths, an input that is not finite, a load that points down, a negative
    speed, a pressure that is not positive, and a table without a measurement.
    """

    slip_angle: np.ndarray
    slip_ratio: np.ndarray
    load: np.ndarray
    camber: np.ndarray | None = None
    speed: np.ndarray | None = None
    pressure: np.ndarray | None = None
    F_x: np.ndarray | None = None
    F_y: np.ndarray | None = None
    M_x: np.ndarray | None = None
    M_y: np.ndarray | None = None
    M_z: np.ndarray | None = None
    run: np.ndarray | None = None
    source: str = "rig table"

    def __post_init__(self):
        for name in COLUMNS:
            if (values := getattr(self, name)) is not None:
                object.__setattr__(self, name, np.asarray(values, dtype=np.float64))
        self._check_shapes()
        for name in (*INPUTS, "run"):
            self._check_rows(name, np.isfinite, "must be finite in every row: leave out the rows without it")
        for name in MEASURED:
            self._check_rows(name, lambda v: ~np.isinf(v), "must be finite, or NaN where nothing was measured")
        if np.median(self.load) <= 0:
            raise InputError(
                f"{self.source}: load = {np.median(self.load):g} in the median: z points up here (ISO-W, TYDEX), so that a "
                "wheel's load is positive. Data in SAE axes must be turned first: y and z change sign."
            )
        self._check_rows("speed", lambda v: v >= 0, "must be at least 0: turn the wheel's axes instead")
        self._check_rows("pressure", lambda v: v > 0, "must be positive (Pa)")

    def _check_shapes(self) -> None:
        shapes = {name: values.shape for name in COLUMNS if (values := getattr(self, name)) is not None}
        if any(len(shape) != 1 or shape != shapes["load"] for shape in shapes.values()):
            raise InputError(f"{self.source}: shapes {shapes}: must all be (n,).")
        if shapes["load"] == (0,):
            raise InputError(f"{self.source}: holds no row.")
        if not any(np.isfinite(getattr(self, name)).any() for name in MEASURED if name in shapes):
            raise InputError(f"{self.source}: no measurement: one of {', '.join(MEASURED)} is needed.")

    def _check_rows(self, name: str, holds, allowed: str) -> None:
        values = getattr(self, name)
        if values is not None and not holds(values).all():
            row = int(np.flatnonzero(~holds(values))[0])
            raise InputError(f"{self.source}: {name} = {values[row]:g} in row {row}: {allowed}.")

    def take(self, rows: np.ndarray) -> RigTable:
        """The table of some rows: indices, or a mask (n,)."""
        return dataclasses.replace(
            self, **{name: values[rows] for name in COLUMNS if (values := getattr(self, name)) is not None}
        )


def read_rig_table(
    path: str | Path | Sequence[str | Path], axes: str = "iso-w", *, measured: Sequence[str] = MEASURED
) -> RigTable:
    """Read rig data from CSV or TYDEX files (.tdx, .tyd, .tydex); several files are joined, each one its run.

    CSV: one header line, columns by the names of `COLUMNS` in SI units, or with a unit in the name (`alpha [deg]`); slips that
    a file does not have are zero; an empty cell is a missing measurement. `axes` of its slip angle: `iso-w`, where a positive
    one gives a negative force, or `ours`. TYDEX files know their axes. `measured`: which forces and moments to read.

    **Raises** `InputError` as `RigTable` and `read_tydex`, for unknown axes, and for files that do not tell the same inputs.
    """
    check_one_of("axes", axes, AXES)
    for name in measured:
        check_one_of("measured", name, MEASURED)
    paths = [Path(path)] if isinstance(path, (str, Path)) else [Path(one) for one in path]
    if not paths:
        raise InputError("read_rig_table: no file; name at least one.")
    tables = [_read(one, axes, tuple(measured)) for one in paths]
    return tables[0] if len(tables) == 1 else join(tables)


def join(tables: Sequence[RigTable]) -> RigTable:
    """One table of several, each one its run, or as many as it has; what only some of them measured is NaN in the others.

    **Raises** `InputError` where only some of them tell of an input.
    """
    joined: dict[str, np.ndarray | None] = {}
    for name in (*INPUTS, *MEASURED):
        parts = [getattr(table, name) for table in tables]
        having = [part is not None for part in parts]
        if name in INPUTS and any(having) and not all(having):
            without = tables[having.index(False)].source
            raise InputError(f"{without}: has no {name}, which other files have: add it there, or read them apart.")
        filled = [np.full(table.load.shape, np.nan) if p is None else p for p, table in zip(parts, tables, strict=True)]
        joined[name] = np.concatenate(filled) if any(having) else None
    runs, first = [], 0.0
    for table in tables:
        own = np.zeros(len(table.load)) if table.run is None else np.unique(table.run, return_inverse=True)[1]
        runs.append(first + own)
        first = runs[-1].max() + 1
    return RigTable(**joined, run=np.concatenate(runs), source=", ".join(table.source for table in tables))


def _read(path: Path, axes: str, measured: tuple[str, ...]) -> RigTable:
    check_suffix(path, (".csv", *TYDEX_SUFFIXES), "rig table")
    if path.suffix.lower() == ".csv":
        return _read_csv(path, axes, measured)
    if axes != AXES[0]:
        raise InputError(f"axes = {axes!r}: {path} is a TYDEX file, which knows its axes; leave `axes` out.")
    return RigTable(**contact_patch(read_tydex(path), measured), source=str(path))


def _read_csv(path: Path, axes: str, measured: tuple[str, ...]) -> RigTable:
    check_readable(path)
    cells = {split_unit(heading): column for heading, column in read_columns(path).items()}
    units = dict(cells.keys())
    columns = {name: column for (name, _), column in cells.items()}
    _refuse_turn_slip(path, columns)
    found: dict[str, np.ndarray] = {}
    for field, (names, unit) in COLUMNS.items():
        name = next((name for name in names if name in columns), None)
        if name is None or (field in MEASURED and field not in measured):
            continue
        values = numeric(columns[name], f"{path}: column {name!r}")
        found[field] = convert(values, units[name], unit, f"{path}: {name}") if given(units[name]) else values
    if "load" not in found:
        raise InputError(f"{path}: no load among the columns {', '.join(columns)}: {COLUMNS['load'][0][0]} is needed.")
    if "slip_angle" not in found and "slip_ratio" not in found:
        raise InputError(f"{path}: no slip among the columns {', '.join(columns)}: in_alpha or in_kappa is needed.")
    zero = np.zeros(len(found["load"]))
    found = {"slip_angle": zero, "slip_ratio": zero, **found}
    if axes == "iso-w":
        found["slip_angle"] = 0.0 - found["slip_angle"]
    # For the reference evaluator a pressure of zero is the nominal one.
    if "pressure" in found and not found["pressure"].any():
        del found["pressure"]
    return RigTable(**found, source=str(path))


def _refuse_turn_slip(path: Path, columns: dict) -> None:
    for name in ("in_phit", "phit", "turn_slip"):
        if name in columns and numeric(columns[name], f"{path}: column {name!r}").any():
            raise InputError(
                f"{path}: {name} is not 0 in every row: a rig table has no turn slip; leave these rows out."
            )
