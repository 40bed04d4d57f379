"""Findings about a tyre property file: a list of oddities to read before the tyre is used.

The restrictions C > 0, D > 0, E <= 1, B_t > 0 and positive weights of combined slip over the file's own ranges are those of
H. B. Pacejka, Tire and Vehicle Dynamics, 3rd edition (2012), section 4.3.2. The other limits are wide ranges for road tyres,
from racing cars to trucks.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh.io import PropertyFile, kit, read_property_file
from jaxveh.tyres.base import Contact, Forces
from jaxveh.tyres.mf_tyre import MFTyre
from jaxveh.tyres.property_file import SIDES, from_property_file, tells
from jaxveh.tyres.property_lines import PropertyFinding, first_of, odd_lines

USUAL = {
    "mu_x": ("longitudinal friction", 0.2, 3.0, ""),
    "mu_y": ("lateral friction", 0.2, 3.0, ""),
    "K_xk": ("slip stiffness over load", 5.0, 80.0, ""),
    "K_ya": ("cornering stiffness over load", 3.0, 60.0, " 1/rad"),
    "rho": ("deflection over radius", 0.01, 0.2, ""),
    "trail": ("pneumatic trail over radius", 0.0, 0.3, ""),
    "F_y": ("lateral force without slip angle over load", -0.1, 0.1, ""),
    "sigma_x": ("longitudinal relaxation length", 0.01, 3.0, " m"),
    "sigma_y": ("lateral relaxation length", 0.01, 3.0, " m"),
}
"""Quantities of a tyre that rolls freely at its nominal load: the name, the usual least and greatest value, and the unit."""

PER_LOAD, PER_RADIUS = ("K_xk", "K_ya", "F_y"), ("rho", "trail")

GRID = 11
"""The number of points over a range of the file."""


def check_property_file(source: str | Path | PropertyFile) -> list[PropertyFinding]:
    """Findings about a .tir file; an empty list if there are none.

    `source`: the path, or the `PropertyFile`. The function reports missing values, odd ranges and units, scaling factors other
    than 1, entries that are not read or cannot be read, and unusual behaviour of the tyre. **Raises** `InputError` where
    `from_property_file` does.
    """
    file = source if isinstance(source, PropertyFile) else read_property_file(source)
    tyre = from_property_file(file)
    freely = _freely(tyre)
    return [
        *_model(file, tyre.version),
        *_missing_values(file, tyre),
        *_ranges(file, tyre),
        *_pressure(file, tyre),
        *_scaling_findings(tyre),
        *_body(tyre),
        *_shapes(tyre),
        *_usual(tyre, freely),
        *_friction_over_range(freely),
        *_curvature(tyre),
        *_aligning_findings(tyre),
        *_combined_findings(tyre),
        *_moments(tyre),
        *odd_lines(file, tyre),
    ]


def _model(file: PropertyFile, version: int) -> Iterator[PropertyFinding]:
    side, kind, mode = (first_of(file, key) for key in ("TYRESIDE", "PROPERTY_FILE_FORMAT", "USE_MODE"))
    if side is None:
        yield PropertyFinding("TYRESIDE", "is missing: the side for which the coefficients hold is unknown")
    elif str(side.value).strip().lower() not in SIDES:
        yield PropertyFinding("TYRESIDE", f"is {side.short_value}, neither LEFT nor RIGHT: the tyre cannot be mirrored")
    if file.find("FITTYP") is None and kind is not None and str(kind.value).upper().startswith("MF"):
        yield PropertyFinding(
            "FITTYP", f"is missing: {version / 10:g} is used because of PROPERTY_FILE_FORMAT = {kind.short_value}"
        )
    elif file.text("FITTYP") == "60":
        yield PropertyFinding("FITTYP", "is 60: the equations of 6.1 are used")
    if mode is not None and not isinstance(mode.value, str):
        if mode.value < 0:
            yield PropertyFinding(
                "USE_MODE", f"is {mode.value:g}: asks for a mirrored tyre; the tyre is not mirrored (see `side`)"
            )
        elif abs(mode.value) % 10 < 4:
            yield PropertyFinding(
                "USE_MODE", f"is {mode.value:g}: fitted without combined slip; combined slip is computed nevertheless"
            )
    if "UNITS" not in file.sections:
        yield PropertyFinding("[UNITS]", "is missing: SI units and radians are assumed")
    angle = str(file.sections.get("UNITS", {}).get("ANGLE", "radian")).strip().lower()
    if angle not in kit.PROPERTY_UNITS["ANGLE"]:
        yield PropertyFinding("ANGLE", f"is {angle!r}: ranges and coefficients are read in radians nevertheless")


def _missing_values(file: PropertyFile, tyre: MFTyre) -> Iterator[PropertyFinding]:
    """Missing values with defaults that should not be relied on."""
    wanted = ["LONGVL", "VERTICAL_STIFFNESS"]
    if tyre.version != 52:
        wanted += ["NOMPRES", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS"]
    for key in wanted:
        if not tells(file, key):
            yield PropertyFinding(key, f"is missing: {float(getattr(tyre.structure, key)):g} is used")
    speed = float(tyre.structure.LONGVL)
    if not 5 <= speed <= 50:
        yield PropertyFinding(
            "LONGVL", f"is {speed:g} m/s: tyres are measured at 5 to 50 m/s, mostly 16.7; is it in km/h?"
        )


def _ranges(file: PropertyFile, tyre: MFTyre) -> Iterator[PropertyFinding]:
    r, load = tyre.ranges, float(tyre.scaling.LFZO * tyre.structure.FNOMIN)
    for low, high in (
        ("KPUMIN", "KPUMAX"), ("ALPMIN", "ALPMAX"), ("CAMMIN", "CAMMAX"), ("FZMIN", "FZMAX"), ("PRESMIN", "PRESMAX"),
    ):  # fmt: skip
        least, most = float(getattr(r, low)), float(getattr(r, high))
        if least >= most:
            yield PropertyFinding(f"{low}, {high}", f"are {least:g} and {most:g}: the range is empty")
        elif low in ("KPUMIN", "ALPMIN", "CAMMIN") and not least < 0 < most:
            yield PropertyFinding(
                f"{low}, {high}", f"are {least:g} and {most:g}: only one side was measured, the other is limited to 0"
            )
    for key, largest in (("ALPMIN", 3.2), ("ALPMAX", 3.2), ("CAMMIN", 3.2), ("CAMMAX", 3.2)):
        if abs(float(getattr(r, key))) > largest:
            yield PropertyFinding(key, f"is {float(getattr(r, key)):g}: must be in radians; is it in degrees?")
    for key in ("KPUMIN", "KPUMAX"):
        if file.find(key) is not None and abs(float(getattr(r, key))) > 5:
            yield PropertyFinding(key, f"is {float(getattr(r, key)):g}: a slip ratio of 1 is 100 %; is it in per cent?")
    if not float(r.FZMIN) <= load <= float(r.FZMAX):
        yield PropertyFinding(
            "FNOMIN", f"times LFZO is {load:g} N, outside FZMIN to FZMAX, {float(r.FZMIN):g} to {float(r.FZMAX):g} N"
        )


def _pressure(file: PropertyFile, tyre: MFTyre) -> Iterator[PropertyFinding]:
    r = tyre.ranges
    for key in ("NOMPRES", "INFLPRES"):
        if not tells(file, key):
            continue
        value = float(getattr(tyre.structure, key))
        if not 2e4 <= value <= 2e6:
            yield PropertyFinding(
                key, f"is {value:g} Pa: tyres have 20 to 2000 kPa; are [UNITS] those of the pressure?"
            )
        elif not float(r.PRESMIN) <= value <= float(r.PRESMAX):
            yield PropertyFinding(
                key, f"is {value:g} Pa, outside PRESMIN to PRESMAX, {float(r.PRESMIN):g} to {float(r.PRESMAX):g} Pa"
            )


def _scaling_findings(tyre: MFTyre) -> Iterator[PropertyFinding]:
    factors = {name: float(value) for name, value in vars(tyre.scaling).items()}
    changed = [f"{name} = {value:g}" for name, value in factors.items() if value != 1]
    if changed:
        yield PropertyFinding("scaling", f"{', '.join(changed)}: not 1, so the tyre differs from the measured one")


def _body(tyre: MFTyre) -> Iterator[PropertyFinding]:
    s = tyre.structure
    radius, rim, load = float(s.UNLOADED_RADIUS), float(s.RIM_RADIUS), float(s.FNOMIN)
    if not 0.05 <= radius <= 1.5:
        yield PropertyFinding("UNLOADED_RADIUS", f"is {radius:g} m: wheels have 0.05 to 1.5 m; does [UNITS] hold?")
    if rim >= radius:
        yield PropertyFinding("RIM_RADIUS", f"is {rim:g} m, not less than UNLOADED_RADIUS, {radius:g} m")
    if not 100 <= load <= 1e5:
        yield PropertyFinding("FNOMIN", f"is {load:g} N: wheels carry 100 to 100000 N; does [UNITS] hold?")


def _shapes(tyre: MFTyre) -> Iterator[PropertyFinding]:
    for key, shape in (
        ("PCX1", tyre.longitudinal.PCX1 * tyre.scaling.LCX),
        ("PCY1", tyre.lateral.PCY1 * tyre.scaling.LCY),
    ):
        if float(shape) <= 0:
            yield PropertyFinding(key, f"gives a shape factor C of {float(shape):g}: must be positive")
        elif not 1 <= float(shape) <= 2:
            what = "the force never peaks" if float(shape) < 1 else "the force reverses its sign at large slip"
            yield PropertyFinding(key, f"gives a shape factor C of {float(shape):g}: usual values are 1 to 2; {what}")


class _Freely(NamedTuple):
    """A tyre without limits that rolls freely: first at its nominal load, then at every load, camber and pressure of the ranges.

    All points are evaluated together, so that only one program is compiled.
    """

    load: np.ndarray
    camber: np.ndarray
    pressure: np.ndarray
    found: dict[str, Any]


def _freely(tyre: MFTyre) -> _Freely:
    r, s = tyre.ranges, tyre.structure
    own = float(s.INFLPRES)
    pressures = [max(float(r.PRESMIN), own / 2), own, min(float(r.PRESMAX), own * 2)]
    grid = np.meshgrid(_loads(tyre), [float(r.CAMMIN), 0.0, float(r.CAMMAX)], pressures)
    nominal = float(s.FNOMIN * tyre.scaling.LFZO), 0.0, own
    load, camber, pressure = (np.append(at, values) for at, values in zip(nominal, grid, strict=True))
    at = Contact(load=jnp.asarray(load), camber=jnp.asarray(camber), pressure=jnp.asarray(pressure))
    # With limits the friction in the outputs is positive for any coefficients.
    return _Freely(load, camber, pressure, _outputs(dataclasses.replace(tyre, limits=False), at))


def _usual(tyre: MFTyre, freely: _Freely) -> Iterator[PropertyFinding]:
    """The freely rolling tyre at its nominal load compared with the ranges in `USUAL`."""
    s = tyre.structure
    for field, (what, least, most, unit) in USUAL.items():
        value = float(np.broadcast_to(freely.found[field], freely.load.shape)[0])
        if field in PER_LOAD:
            value /= float(s.FNOMIN * tyre.scaling.LFZO)
        elif field in PER_RADIUS:
            value /= float(s.UNLOADED_RADIUS)
        if not least <= value <= most:
            advice = "; is PKY1 meant for other axes than ISO-W?" if field == "K_ya" and value < 0 else ""
            yield PropertyFinding(
                what, f"is {value:.3g}{unit} at nominal load; usual values are {least:g} to {most:g}{advice}"
            )


def _friction_over_range(freely: _Freely) -> Iterator[PropertyFinding]:
    """D > 0 at every load, camber and pressure of the ranges, checked if it is positive at nominal load."""
    load, camber, pressure = freely.load, freely.camber, freely.pressure
    for field, what in (("mu_x", "longitudinal friction"), ("mu_y", "lateral friction")):
        mu = np.broadcast_to(freely.found[field], load.shape)
        if mu[0] > 0 >= mu.min():
            worst = mu.argmin()
            place = (
                f"{load[worst]:g} N, camber {math.degrees(camber[worst]):.3g} degrees, {pressure[worst] / 1e5:.3g} bar"
            )
            yield PropertyFinding(what, f"is {mu.min():.3g} at {place}, within the file's ranges: must be positive")


def _curvature(tyre: MFTyre) -> Iterator[PropertyFinding]:
    """E <= 1 at every load at zero camber (with camber most files violate it by far); the equations limit it to 1."""
    x, y, z, s, df_z = tyre.longitudinal, tyre.lateral, tyre.aligning, tyre.scaling, _df_z(tyre)
    along = (x.PEX1 + x.PEX2 * df_z + x.PEX3 * df_z**2) * s.LEX
    across = (y.PEY1 + y.PEY2 * df_z) * s.LEY
    trail = z.QEZ1 + z.QEZ2 * df_z + z.QEZ3 * df_z**2
    curvatures = {
        "PEX1 to PEX4": along + jnp.abs(along * x.PEX4),
        "PEY1 to PEY3": across + jnp.abs(across * y.PEY3),
        "QEZ1 to QEZ4": trail + jnp.abs(trail * z.QEZ4),
        "REX1, REX2": x.REX1 + x.REX2 * df_z,
        "REY1, REY2": y.REY1 + y.REY2 * df_z,
    }
    for about, curvature in curvatures.items():
        worst = int(jnp.argmax(curvature))
        if curvature[worst] > 1:
            says = f"give a curvature factor E of {float(curvature[worst]):.3g} at {_loads(tyre)[worst]:.0f} N: limited to 1"
            yield PropertyFinding(about, says)


def _aligning_findings(tyre: MFTyre) -> Iterator[PropertyFinding]:
    z, df_z = tyre.aligning, _df_z(tyre)
    if float(z.QDZ1) == 0 and float(z.QDZ2) == 0:
        return  # no trail was fitted
    if float(z.QCZ1) <= 0:
        yield PropertyFinding("QCZ1", f"is {float(z.QCZ1):g}: the shape factor of the trail must be positive")
    slope = np.asarray(z.QBZ1 + z.QBZ2 * df_z + z.QBZ3 * df_z**2)
    if slope.min() <= 0:
        load = _loads(tyre)[slope.argmin()]
        yield PropertyFinding(
            "QBZ1 to QBZ3", f"give a slope of the trail of {slope.min():.3g} at {load:g} N: must be positive"
        )


def _combined_findings(tyre: MFTyre) -> Iterator[PropertyFinding]:
    """The weights of combined slip are positive: the other slip reduces a force and never reverses its sign."""
    r = tyre.ranges
    slip_ratio, slip_angle = min(-float(r.KPUMIN), 0.5), min(float(r.ALPMAX), 0.5)
    if slip_ratio <= 0 or slip_angle <= 0:
        return
    load, ratio, angle = np.meshgrid(
        _loads(tyre)[1:], np.linspace(0.05, 1, 2 * GRID) * slip_ratio, np.linspace(0.05, 1, 2 * GRID) * slip_angle
    )
    force = lambda a, k: _forces(
        tyre, Contact(slip_angle=jnp.asarray(a), slip_ratio=jnp.asarray(k), load=jnp.asarray(load))
    )
    none = np.zeros_like(angle)
    brakes, turns = force(angle, -ratio), force(-angle, -ratio)
    alone_x, alone_y = force(none, -ratio).F_x, force(angle, none).F_y - force(-angle, none).F_y
    # The force that slip ratio adds to F_y is the same at both slip angles, so that their difference does not contain it.
    for about, name, weight, slip in (
        ("RBX1 to RHX1", "F_x", _share(brakes.F_x, alone_x, load), np.degrees(angle)),
        ("RBY1 to RHY2", "F_y", _share(brakes.F_y - turns.F_y, alone_y, load), -ratio),
    ):
        if weight.min() < 0:
            worst, unit = np.unravel_index(weight.argmin(), weight.shape), " degrees" if name == "F_x" else ""
            what = "slip angle" if name == "F_x" else "slip ratio"
            says = f"reverse {name}: {weight.min():.3g} of it remains at {load[worst]:.0f} N and a {what} of"
            yield PropertyFinding(about, f"{says} {slip[worst]:.3g}{unit}; must be positive")


def _share(force: jax.Array, alone: jax.Array, load: np.ndarray) -> np.ndarray:
    """What the other slip leaves of a force; 1 where there is none to reverse, as with a friction of zero."""
    return np.divide(force, alone, out=np.ones(load.shape), where=np.abs(alone) > 1e-9 * load)


def _moments(tyre: MFTyre) -> Iterator[PropertyFinding]:
    c = vars(tyre.overturning)
    told = lambda numbers: [f"QSX{k}" for k in numbers if float(c[f"QSX{k}"]) != 0]
    first, second = told(range(1, 12)), told(range(12, 15))
    if tyre.version == 61 and first and second:
        yield PropertyFinding(
            ", ".join(second), "are not 0, nor are QSX1 to QSX11: two forms of M_x that MF-Tyre does not use together"
        )
    rolling = float(tyre.rolling.QSY1)
    if not 0 <= rolling <= 0.05:
        yield PropertyFinding("QSY1", f"is {rolling:g}: rolling resistance over load is usually 0 to 0.05")


@eqx.filter_jit
def _outputs(tyre: MFTyre, contact: Contact) -> dict[str, Any]:
    found = tyre.outputs(contact)
    return {field: getattr(found, field) for field in USUAL}


@eqx.filter_jit
def _forces(tyre: MFTyre, contact: Contact) -> Any:
    """The forces without the moments, which take most of the compilation time."""
    found = tyre.forces(contact)
    return Forces(F_x=found.F_x, F_y=found.F_y)


def _loads(tyre: MFTyre) -> np.ndarray:
    """Loads over the file's range, but only from a tenth to three times the nominal load."""
    r, nominal = tyre.ranges, float(tyre.structure.FNOMIN * tyre.scaling.LFZO)
    return np.linspace(max(float(r.FZMIN), 0.1 * nominal), min(float(r.FZMAX), 3 * nominal), GRID)


def _df_z(tyre: MFTyre) -> jax.Array:
    return jnp.asarray(_loads(tyre)) / (tyre.scaling.LFZO * tyre.structure.FNOMIN) - 1
