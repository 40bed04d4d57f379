"""Rig data: the measurements of a tyre on a test rig, row by row."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jaxveh._core.errors import InputError, check_one_of, path_of
from jaxveh._core.host import check_on_host
from jaxveh._core.names import as_several
from jaxveh.io.csv_log import read_columns
from jaxveh.io.files import check_readable, check_suffix
from jaxveh.io.log import numeric
from jaxveh.io.naming import split_unit
from jaxveh.io.rig_axes import AXES, to_ours
from jaxveh.io.rig_shown import RigShown
from jaxveh.io.ttc import SUFFIXES as TTC_SUFFIXES
from jaxveh.io.ttc import names_line, read_ttc
from jaxveh.io.tydex import read_tydex
from jaxveh.io.tydex_axes import contact_patch
from jaxveh.io.units import convert, is_unit

INPUTS = ("slip_angle", "slip_ratio", "load", "camber", "speed", "pressure")
RIG_CHANNELS = ("F_x", "F_y", "M_x", "M_y", "M_z")
"""Forces (N) and moments (N m) of a rig table."""
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
"""Names of the columns of a CSV file (the first that is present counts), and the unit of a name without one."""

LARGEST = {"slip_angle": 1.0, "camber": 1.2}
"""Angles (rad) beyond which numbers without a unit are refused: 57 degrees of slip, 69 of camber."""

OTHER_UNITS = {
    "slip_angle": (0.0, LARGEST["slip_angle"], "deg"),
    "camber": (0.0, LARGEST["camber"], "deg"),
    "slip_ratio": (0.0, 5.0, "%"),
    "load": (50.0, np.inf, "kN"),
    "pressure": (5000.0, np.inf, "kPa"),
}
"""The range of the largest size of numbers without a unit, in SI, and the unit that they probably have outside it."""

RIGHT_ANGLE = np.pi / 2


@dataclass(frozen=True, eq=False, repr=False)
class RigTable(RigShown):
    """Measurements of a tyre; float arrays (n,) in SI units and this package's axes (x forward, y left, z up).

    Inputs: `slip_angle` (rad, a positive one gives a positive force), `slip_ratio` (-), `load` (N); `camber` (rad), `speed`
    (m/s) and `pressure` (Pa) are None if unknown. Measurements: `F_x`, `F_y` (N), `M_x`, `M_y`, `M_z` (N m) at the contact
    patch, None if not measured, NaN where a value is missing. `run` (n,) is the number of the sweep that a row belongs to.

    **Raises** `InputError` for arrays of different lengths, an input that is not finite, a load that points down, a negative
    speed, a pressure that is not positive, and a table without a measurement.
    """

    units: ClassVar[dict[str, str]] = {
        name: "N m" if unit == "N*m" else unit.replace("dimensionless", "") for name, (_, unit) in COLUMNS.items()
    }

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
                check_on_host(f"RigTable.{name}", values)
                object.__setattr__(self, name, np.asarray(values, dtype=np.float64))
        self._check_shapes()
        for name in (*INPUTS, "run"):
            self._check_rows(name, np.isfinite, "must be finite in every row: leave out the rows without it")
        for name in RIG_CHANNELS:
            self._check_rows(name, lambda v: ~np.isinf(v), "must be finite, or NaN where nothing was measured")
        if np.median(self.load) <= 0:
            raise InputError(
                f"{self.source}: the median load is {np.median(self.load):g}: it must be positive, as in ISO-W and "
                "TYDEX, where z points up; for SAE's axes, where FZ is negative, give axes = 'sae' (--axes sae)."
            )
        for name in LARGEST:
            self._check_rows(
                name, lambda v: np.abs(v) <= RIGHT_ANGLE, "must be radians within a right angle: degrees? (np.radians)"
            )
        self._check_rows("speed", lambda v: v >= 0, "must be at least 0: turn the axes of the wheel instead")
        self._check_rows("pressure", lambda v: v > 0, "must be positive (Pa)")

    def _check_shapes(self) -> None:
        shapes = {name: values.shape for name in COLUMNS if (values := getattr(self, name)) is not None}
        if any(len(shape) != 1 or shape != shapes["load"] for shape in shapes.values()):
            raise InputError(f"{self.source}: shapes {shapes}: must all be (n,).")
        if shapes["load"] == (0,):
            raise InputError(f"{self.source}: has no rows.")
        if not any(np.isfinite(getattr(self, name)).any() for name in RIG_CHANNELS if name in shapes):
            raise InputError(f"{self.source}: no measurement: one of {', '.join(RIG_CHANNELS)} is needed.")

    def _check_rows(self, name: str, holds, allowed: str) -> None:
        values = getattr(self, name)
        if values is not None and not holds(values).all():
            row = int(np.flatnonzero(~holds(values))[0])
            raise InputError(f"{self.source}: {name} = {values[row]:g} in row {row}: {allowed}.")

    def take(self, rows: np.ndarray) -> RigTable:
        """Return the table of some `rows`: indices, or a mask (n,)."""
        return dataclasses.replace(
            self, **{name: values[rows] for name in COLUMNS if (values := getattr(self, name)) is not None}
        )


def read_rig_table(
    path: str | Path | Sequence[str | Path], axes: str | None = None, *, measured: Sequence[str] = RIG_CHANNELS
) -> RigTable:
    """Read rig data; several files are joined, each as a run. The kind of a file follows from its suffix and its columns:

    - CSV with the names of `COLUMNS` in SI units, or with a unit in the name (`alpha [deg]`) or in a line below the names;
      missing slips are zero; an empty cell is a missing measurement. Separators and decimal commas are found
      (`csv_layout.find_layout`).
    - Files of the Formula SAE Tire Test Consortium (`.dat`, `.txt`, `.mat`, and a `.csv` with its names): see `ttc.read_ttc`.
    - TYDEX (`.tdx`, `.tyd`, `.tydex`): see `tydex.read_tydex`.

    `axes`: the sign convention of the file, one of `rig_axes.AXES`. The default depends on the kind: ISO-W for CSV and TYDEX (a
    positive slip angle gives a negative force), SAE for the consortium's files, where FZ is negative. `measured`: the forces
    and moments to read.

    **Raises** `InputError` like `RigTable`, `read_ttc` and `read_tydex`, for unknown axes, for numbers without a unit that
    cannot be in SI units (`OTHER_UNITS`), for the consortium's files if FZ is not negative as in SAE's axes and `axes` is not
    given, and for files with different inputs.
    """
    if axes is not None:
        check_one_of("axes", axes, AXES)
    for name in measured:
        check_one_of("measured", name, RIG_CHANNELS)
    paths = [path_of(path)] if isinstance(path, (str, Path)) else [path_of(one) for one in as_several(path, "path")]
    if not paths:
        raise InputError("read_rig_table: no file; name at least one.")
    tables = [_read(one, axes, tuple(measured)) for one in paths]
    return tables[0] if len(tables) == 1 else join(tables)


def join(tables: Sequence[RigTable]) -> RigTable:
    """Join several tables; each is a run, or keeps its own runs. A quantity that only some of them measured is NaN in the others.

    **Raises** `InputError` if only some of them have an input.
    """
    joined: dict[str, np.ndarray | None] = {}
    for name in (*INPUTS, *RIG_CHANNELS):
        parts = [getattr(table, name) for table in tables]
        having = [part is not None for part in parts]
        if name in INPUTS and any(having) and not all(having):
            without = tables[having.index(False)].source
            raise InputError(
                f"{without}: has no {name}, which other files have: add it there, or read the files separately."
            )
        filled = [np.full(table.load.shape, np.nan) if p is None else p for p, table in zip(parts, tables, strict=True)]
        joined[name] = np.concatenate(filled) if any(having) else None
    runs, first = [], 0.0
    for table in tables:
        own = np.zeros(len(table.load)) if table.run is None else np.unique(table.run, return_inverse=True)[1]
        runs.append(first + own)
        first = runs[-1].max() + 1
    return RigTable(**joined, run=np.concatenate(runs), source=", ".join(table.source for table in tables))


def _read(path: Path, axes: str | None, measured: tuple[str, ...]) -> RigTable:
    suffix = check_suffix(path, (".csv", *TTC_SUFFIXES, *TYDEX_SUFFIXES), "rig table")
    check_readable(path)
    if suffix in TYDEX_SUFFIXES:
        columns, usual = contact_patch(read_tydex(path), measured, axes or "iso-w"), "iso-w"
    elif suffix in TTC_SUFFIXES or names_line(path) is not None:
        found = read_ttc(path).columns
        columns = {name: values for name, values in found.items() if name not in RIG_CHANNELS or name in measured}
        usual = _ttc_axes(path, columns["load"]) if axes is None else axes
    else:
        columns, usual = _read_csv(path, measured), "iso-w"
    return RigTable(**to_ours(columns, axes or usual), source=str(path))


def _ttc_axes(path: Path, load: np.ndarray) -> str:
    """Return SAE's axes, the usual ones of the consortium's files, after a check of the sign of FZ."""
    if load.size and np.nanmedian(load) > 0:
        raise InputError(
            f"{path}: the median FZ is {np.nanmedian(load):g} N, but it is negative in SAE's axes, the usual axes of the FSAE "
            "TTC's files; give the axes of this file: axes = 'adapted-sae' or 'iso-w' (--axes)."
        )
    return "sae"


def _read_csv(path: Path, measured: tuple[str, ...]) -> dict[str, np.ndarray | None]:
    table = read_columns(path)
    told = lambda heading: (heading, table.units[heading]) if table.units.get(heading) else split_unit(heading)
    plain = {heading: told(heading) for heading in table.headings}
    # Of columns with the same heading, `cells` has the last one.
    names = [plain[heading][0] for heading in table.headings if heading]
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        raise InputError(f"{path}: several columns are named {', '.join(map(repr, twice))}; rename them.")
    units = dict(plain.values())
    columns = {
        name: lambda heading=heading: numeric(table.cells[heading], f"{path}: column {heading!r}", table.point)
        for heading, (name, _) in plain.items()
    }
    _refuse_turn_slip(path, columns)
    found: dict[str, np.ndarray | None] = {}
    for field, (names, unit) in COLUMNS.items():
        name = next((name for name in names if name in columns), None)
        if name is None or (field in RIG_CHANNELS and field not in measured):
            continue
        values = columns[name]()
        if not is_unit(units[name]):
            _refuse_other_unit(path, field, name, values)
        found[field] = convert(values, units[name], unit, f"{path}: {name}") if is_unit(units[name]) else values
    if "load" not in found:
        raise InputError(f"{path}: no load among the columns {', '.join(columns)}: {COLUMNS['load'][0][0]} is needed.")
    if "slip_angle" not in found and "slip_ratio" not in found:
        raise InputError(f"{path}: no slip among the columns {', '.join(columns)}: in_alpha or in_kappa is needed.")
    zero = np.zeros(len(np.asarray(found["load"])))
    found = {"slip_angle": zero, "slip_ratio": zero, **found}
    # In the reference evaluator a pressure of zero means the nominal pressure.
    if found.get("pressure") is not None and not np.any(found["pressure"]):
        del found["pressure"]
    return found


def _refuse_other_unit(path: Path, field: str, name: str, values: np.ndarray) -> None:
    """Raise `InputError` if numbers without a unit cannot be in SI units."""
    low, high, likely = OTHER_UNITS.get(field, (0.0, np.inf, ""))
    size = float(np.nanmax(np.abs(values), initial=0.0))
    if low <= size <= high or size == 0:
        return
    unit = COLUMNS[field][1].replace("dimensionless", "1")
    shown = f", {np.degrees(size):.0f} degrees" if unit == "rad" else ""
    raise InputError(
        f"{path}: {name} goes to {size:.4g} without a unit, which would be in {unit}{shown}: name the column '{name} [{likely}]' "
        f"(or another unit), or '{name} [{unit}]' if that is right."
    )


def _refuse_turn_slip(path: Path, columns: dict) -> None:
    for name in ("in_phit", "phit", "turn_slip"):
        if name in columns and columns[name]().any():
            raise InputError(
                f"{path}: {name} is not 0 in every row: a rig table has no turn slip; leave these rows out."
            )
