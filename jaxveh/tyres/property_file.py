"""Tyres from tyre property files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Literal, overload

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_one_of
from jaxveh.io import PropertyFile, read_property_file
from jaxveh.tyres.mf_tyre import (
    AligningCoefficients,
    LateralCoefficients,
    LongitudinalCoefficients,
    MFTyre,
    OverturningCoefficients,
    Ranges,
    RollingCoefficients,
    Scaling,
    Structure,
    TurnSlip,
)
from jaxveh.tyres.mf_tyre.typical import TYPICAL_COEFFICIENTS
from jaxveh.tyres.mirrored import Mirrored

SIDES = ("left", "right")
"""The allowed values of TYRESIDE, in upper or lower case."""

VERSION_OF_FITTYP = {5: 52, 6: 52, 21: 52, 52: 52, 60: 61, 61: 61, 62: 62}
"""The version of the equations for each value of the key FITTYP."""

OLD_FORMATS = ("PAC2002", "MF_05", "MF-TYRE", "MF_TYRE")
"""The values of PROPERTY_FILE_FORMAT of files that need no FITTYP: their equations are those of version 5.2."""

OTHER_LAWS = {
    "FIALA": "Fiala", "UA": "University of Arizona", "521": "5.2.1", "PAC89": "Pacejka '89", "PAC94": "Pacejka '94",
    "PACTIME": "PAC-TIME", "PACMC": "motorcycle", "FTIRE": "FTire", "CDTIRE": "CDTire", "RMODK": "RMOD-K",
}  # fmt: skip
"""The letters and digits of PROPERTY_FILE_FORMAT in files of other laws, and the laws. Some of them have coefficients with the
names of MF-Tyre and another meaning (the camber of a motorcycle's tyre)."""

NEEDED = ("FNOMIN", "UNLOADED_RADIUS", "PCX1", "PDX1", "PKX1", "PCY1", "PDY1", "PKY1", "PKY2")
"""The required coefficients; `TYPICAL_COEFFICIENTS` has the defaults of the others."""

NOT_MEASURED = (
    "WIDTH", "VERTICAL_STIFFNESS", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS", "NOMPRES", "INFLPRES", "LONGVL", "Q_RE0",
)  # fmt: skip
"""Quantities that must be positive; tools write zero if they were not measured."""

DIMENSIONS = {
    "UNLOADED_RADIUS": (1, 0, 0), "WIDTH": (1, 0, 0), "RIM_RADIUS": (1, 0, 0), "BOTTOM_OFFST": (1, 0, 0),
    "LONGVL": (1, 0, -1), "VXLOW": (1, 0, -1), "FNOMIN": (0, 1, 0), "FZMIN": (0, 1, 0), "FZMAX": (0, 1, 0),
    "VERTICAL_STIFFNESS": (-1, 1, 0), "LONGITUDINAL_STIFFNESS": (-1, 1, 0), "LATERAL_STIFFNESS": (-1, 1, 0),
    "NOMPRES": (-2, 1, 0), "INFLPRES": (-2, 1, 0), "PRESMIN": (-2, 1, 0), "PRESMAX": (-2, 1, 0),
}  # fmt: skip
"""The powers of the file's units of length, force and time in each quantity with a dimension."""


@overload
def from_property_file(
    source: str | Path | PropertyFile,
    *,
    side: None = None,
    limits: bool = True,
    angles: bool = True,
    spins: bool = False,
) -> MFTyre: ...


@overload
def from_property_file(
    source: str | Path | PropertyFile,
    *,
    side: Literal["left", "right"],
    limits: bool = True,
    angles: bool = True,
    spins: bool = False,
) -> MFTyre | Mirrored: ...


def from_property_file(
    source: str | Path | PropertyFile,
    *,
    side: Literal["left", "right"] | None = None,
    limits: bool = True,
    angles: bool = True,
    spins: bool = False,
) -> MFTyre | Mirrored:
    """The tyre of a .tir file of MF-Tyre 5.2 (PAC2002, MF_05), 6.1 or 6.2, in SI units.

    `source`: the path, or the `PropertyFile`. `side`, `left` or `right`: the side of the car on which the tyre is mounted. The
    tyre is mirrored if TYRESIDE, the side for which the file's coefficients hold, is the other one. None: it is not mirrored.
    The version comes from FITTYP or PROPERTY_FILE_FORMAT; `limits`, `angles` and `spins` as in `MFTyre`. Missing coefficients
    are those of `TYPICAL_COEFFICIENTS`, or zero. An entry without a value counts as missing, and so does a zero in
    `NOT_MEASURED`; `check_property_file` reports both.

    **Raises** `InputError` for an unknown version, a file of another law (`OTHER_LAWS`), a coefficient of the tyre that is not a
    finite number (entries that the tyre does not use may have any value), a required coefficient that is missing, and a `side`
    if the file has no TYRESIDE.
    """
    check_flags(limits=limits, angles=angles, spins=spins)
    file = source if isinstance(source, PropertyFile) else read_property_file(source)
    tyre = _as_it_is(file, limits, angles, spins)
    if side is None:
        return tyre
    check_one_of("side", side, SIDES)
    return tyre if side == side_of(file) else Mirrored(tyre)


def side_of(file: PropertyFile) -> str:
    """`left` or `right`, the side for which the coefficients hold. **Raises** `InputError` if the file has no valid TYRESIDE."""
    said = file.text("TYRESIDE").strip().lower()
    if said not in SIDES:
        raise InputError(
            f"{file.source}: TYRESIDE = {file.text('TYRESIDE', '')!r}: must be 'LEFT' or 'RIGHT' (in [MODEL]) before the "
            "tyre can be mounted on a side; without `side` it is not mirrored."
        )
    return said


def _as_it_is(file: PropertyFile, limits: bool, angles: bool, spins: bool) -> MFTyre:
    _refuse_other_laws(file)
    for key in NEEDED:
        file.number(key)
    size = {key: size_of(file, powers) for key, powers in DIMENSIONS.items()}

    def section(kind):
        values = _numbers(file, kind, size)
        try:
            return kind(**values)
        except InputError as error:
            raise InputError(f"{file.source}: {error}") from None

    return MFTyre(
        section(Structure),
        section(LongitudinalCoefficients),
        section(LateralCoefficients),
        section(AligningCoefficients),
        section(OverturningCoefficients),
        section(RollingCoefficients),
        section(Scaling),
        section(Ranges),
        section(TurnSlip),
        version=version_of(file),
        limits=limits,
        angles=angles,
        spins=spins,
    )


def _refuse_other_laws(file: PropertyFile) -> None:
    said = file.text("PROPERTY_FILE_FORMAT").strip()
    law = OTHER_LAWS.get("".join(letter for letter in said.upper() if letter.isalnum()))
    if law is not None:
        raise InputError(
            f"{file.source}: PROPERTY_FILE_FORMAT = {said!r}: a tyre of the {law} law; only MF-Tyre 5.2 to 6.2 is read. "
            "Fit an MF-Tyre to this tyre's forces (jaxveh tyre fit), or write its numbers into a law of jaxveh.tyres."
        )


def version_of(file: PropertyFile) -> int:
    """The version of the equations: 52, 61 or 62. **Raises** `InputError` for other versions, and if the file has none."""
    entry = file.find("FITTYP")
    if entry is not None:
        number = file.number("FITTYP")
        if number not in VERSION_OF_FITTYP:
            known = ", ".join(map(str, VERSION_OF_FITTYP))
            raise InputError(f"{file.source}, line {entry.line}: FITTYP = {number:g}: must be one of {known}.")
        return VERSION_OF_FITTYP[int(number)]
    kind = file.text("PROPERTY_FILE_FORMAT").upper()
    if kind not in OLD_FORMATS:
        raise InputError(
            f"{file.source}: neither FITTYP nor a PROPERTY_FILE_FORMAT of {', '.join(OLD_FORMATS)} (it is {kind!r}); "
            "if it is an MF-Tyre, add FITTYP = 61 (or 52, 62) to [MODEL]."
        )
    return 52


def size_of(file: PropertyFile, powers: tuple[int, int, int]) -> float:
    """The factor to SI of a quantity with these powers (see `DIMENSIONS`) of the file's units."""
    length, force, time = powers
    return file.unit("LENGTH") ** length * file.unit("FORCE") ** force * file.unit("TIME") ** time


def tells(file: PropertyFile, key: str) -> bool:
    """Whether the file has a value of this coefficient."""
    entry = file.find(key)
    return entry is not None and not (key in NOT_MEASURED and entry.value == 0)


def _numbers(file: PropertyFile, kind: type, size: dict[str, float]) -> dict[str, float]:
    """The coefficients of one section: those of the file, and typical ones where they are missing."""
    names = [field.name for field in dataclasses.fields(kind)]
    found = {name: TYPICAL_COEFFICIENTS[name] for name in names if name in TYPICAL_COEFFICIENTS}
    found |= {name: _number(file, name, size.get(name, 1.0)) for name in names if tells(file, name)}
    if kind is Structure and "INFLPRES" not in found and "NOMPRES" in found:
        found["INFLPRES"] = found["NOMPRES"]
    return found


def _number(file: PropertyFile, name: str, size: float) -> float:
    """A coefficient in SI units, finite in the precision of a tyre's parameters."""
    value = file.number(name) * size
    largest = float(np.finfo(jax.dtypes.canonicalize_dtype(float)).max)
    if abs(value) > largest:
        raise InputError(
            f"{file.source}: {name} = {file.number(name):g}: must be at most {largest / size:.3g} in size."
        )
    return value
