"""Tyre property files from tyres: a new file, or an existing file with other numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_one_of, word_for
from jaxveh.io import PropertyFile, kit
from jaxveh.tyres.mf_tyre import MFTyre
from jaxveh.tyres.property_file import DIMENSIONS, SIDES, from_property_file, size_of, version_of

FITTYP = {52: 6, 61: 61, 62: 62}
"""The value of FITTYP for each version."""

HEADER = """\
[MDI_HEADER]
FILE_TYPE                = 'tir'
FILE_VERSION             = 3.0
FILE_FORMAT              = 'ASCII'
$ Signs of coefficients are ISO-W's; units are SI and radians.
[UNITS]
LENGTH                   = 'meter'
FORCE                    = 'newton'
ANGLE                    = 'radian'
MASS                     = 'kg'
TIME                     = 'second'
"""

SECTIONS = {
    "MODEL": ("LONGVL", "VXLOW"),
    "DIMENSION": ("UNLOADED_RADIUS", "WIDTH", "ASPECT_RATIO", "RIM_RADIUS"),
    "OPERATING_CONDITIONS": ("INFLPRES", "NOMPRES"),
    "VERTICAL": (
        "FNOMIN", "VERTICAL_STIFFNESS", "BREFF", "DREFF", "FREFF", "Q_RE0", "Q_V1", "Q_V2", "Q_FZ2", "Q_FCX", "Q_FCY",
        "Q_FCY2", "Q_CAM1", "Q_CAM2", "Q_CAM3", "Q_FYS1", "Q_FYS2", "Q_FYS3", "PFZ1", "BOTTOM_OFFST",
    ),
    "STRUCTURAL": (
        "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS", "PCFX1", "PCFX2", "PCFX3", "PCFY1", "PCFY2", "PCFY3",
    ),
    "CONTACT_PATCH": ("Q_RA1", "Q_RA2", "Q_RB1", "Q_RB2", "Q_A1", "Q_A2"),
    "INFLATION_PRESSURE_RANGE": ("PRESMIN", "PRESMAX"),
    "VERTICAL_FORCE_RANGE": ("FZMIN", "FZMAX"),
    "LONG_SLIP_RANGE": ("KPUMIN", "KPUMAX"),
    "SLIP_ANGLE_RANGE": ("ALPMIN", "ALPMAX"),
    "INCLINATION_ANGLE_RANGE": ("CAMMIN", "CAMMAX"),
}  # fmt: skip
"""The sections of the tyre's body and ranges."""

WHOLE = {
    "scaling": "SCALING_COEFFICIENTS",
    "longitudinal": "LONGITUDINAL_COEFFICIENTS",
    "overturning": "OVERTURNING_COEFFICIENTS",
    "lateral": "LATERAL_COEFFICIENTS",
    "rolling": "ROLLING_COEFFICIENTS",
    "aligning": "ALIGNING_COEFFICIENTS",
    "turn_slip": "TURNSLIP_COEFFICIENTS",
}
"""The parts of a tyre with a section of their own."""

ROUNDS = 2
"""Rounds of changes: a nominal pressure that is written can change the default of a missing INFLPRES. A second round adds it."""


class _Coefficient(NamedTuple):
    """A coefficient: its `section`, `name`, `unit` and `value`, an array scalar of the tyre's dtype in SI units."""

    section: str
    name: str
    unit: str
    value: np.ndarray


def to_property_file(
    tyre: MFTyre,
    like: PropertyFile | None = None,
    *,
    side: Literal["left", "right"] | None = None,
    note: str = "",
) -> PropertyFile:
    """The .tir file of a tyre: `io.write_property_file` writes it, `from_property_file` reads the same tyre from it.

    Without `like` the result is a new file in SI units with every coefficient in its usual section; `side` is its TYRESIDE.
    With `like`, a file that was read, the result is the same file with other numbers: comments, columns, units and unknown
    sections stay. Missing coefficients are added to their sections if their default differs from the tyre's value. In units
    other than SI, numbers that are read again may differ in the last digit. `note` becomes comment lines under the file's first
    heading.

    A file does not contain `limits`, `angles` and `spins`. If the tyre has no turn slip, its coefficients are left out.

    **Raises** `InputError` for another kind of tyre (also for a class derived from `MFTyre`, whose changes a file cannot hold),
    coefficients that are not finite scalars, and a `side` together with `like`, which has its own side.
    """
    if type(tyre) is not MFTyre:
        raise InputError(
            f"to_property_file: tyre = {word_for(tyre)}: must be an MFTyre; for other laws use tyres.write_parameters."
        )
    coefficients = list(_coefficients(tyre))
    if like is None:
        return _with_note(_new(tyre, coefficients, side), note)
    if side is not None:
        raise InputError(f"to_property_file: side = {side!r}: {like.source} has its own side; leave `side` out.")
    file = _with_version(like, tyre.version)
    for _ in range(ROUNDS):
        file = _with_changes(file, coefficients)
    return _with_note(file, note)


def _coefficients(tyre: MFTyre) -> Iterable[_Coefficient]:
    section_of = {name: section for section, names in SECTIONS.items() for name in names}
    for part in ("structure", "ranges", *WHOLE):
        module = getattr(tyre, part)
        for field in () if module is None else dataclasses.fields(module):
            section = WHOLE[part] if part in WHOLE else section_of[field.name]
            value = np.asarray(getattr(module, field.name))
            if value.shape != () or not np.isfinite(value):
                raise InputError(f"MFTyre.{part}.{field.name} = {value}: must be one finite number to be written.")
            yield _Coefficient(section, field.name, field.metadata["unit"], value)


def _new(tyre: MFTyre, coefficients: list[_Coefficient], side: str | None) -> PropertyFile:
    lines = [HEADER + "[MODEL]", f"{'FITTYP':<24} = {FITTYP[tyre.version]}"]
    if side is not None:
        check_one_of("side", side, SIDES)
        lines.append(f"{'TYRESIDE':<24} = '{side.upper()}'")
    for section in (*SECTIONS, *WHOLE.values()):
        inside = {one.name: one for one in coefficients if one.section == section}
        # In the order of this table, which differs from that of the tyre's fields.
        names = SECTIONS.get(section, tuple(inside))
        if section != "MODEL" and inside:
            lines.append(f"[{section}]")
        lines += [_line(inside[name], _number(inside[name].value)) for name in names]
    return kit.parse_property_file("\n".join(lines) + "\n", f"MF-Tyre {tyre.version / 10:g}")


def _line(one: _Coefficient, number: float) -> str:
    unit = "" if one.unit == "-" else f"${one.unit}"
    return f"{one.name:<24} = {number!r:<24}{unit}".rstrip()


def _with_version(file: PropertyFile, version: int) -> PropertyFile:
    if file.find("FITTYP") is not None:
        return file if version_of(file) == version else file.replace({"FITTYP": FITTYP[version]})
    try:
        if version_of(file) == version:
            return file
    except InputError:
        pass  # the file has no version: FITTYP is added below
    return _with_lines(file, "MODEL", [f"{'FITTYP':<24} = {FITTYP[version]}"])


def _with_changes(file: PropertyFile, coefficients: list[_Coefficient]) -> PropertyFile:
    """The file with all numbers replaced or added that would otherwise be read with other values than the tyre's."""
    said = {one.name: one.value for one in _coefficients(from_property_file(file))}
    replaced: dict[str, float] = {}
    added: dict[str, list[str]] = {}
    for one in coefficients:
        if said[one.name].astype(one.value.dtype) == one.value:
            continue
        size = size_of(file, DIMENSIONS[one.name]) if one.name in DIMENSIONS else 1.0
        number = _in_units(_number(one.value), size)
        if file.holds(one.name):
            replaced[one.name] = number
        else:
            added.setdefault(one.section, []).append(_line(one._replace(unit="-"), number))
    file = file.replace(replaced)
    for section, lines in added.items():
        file = _with_lines(file, section, lines)
    return file


def _number(value: np.ndarray) -> float:
    """The number with the fewest digits that represents this value in its own precision."""
    return float(str(value[()]))


def _in_units(value: float, size: float) -> float:
    """The number that is read as `value`, or as nearly as possible; the shortest if there are several."""
    near = value / size
    candidates = [float(f"{near:.{digits}g}") for digits in (12, 15)]
    candidates += [near, math.nextafter(near, math.inf), math.nextafter(near, -math.inf)]
    return min(candidates, key=lambda one: abs(one * size - value))


def _with_lines(file: PropertyFile, section: str, lines: list[str]) -> PropertyFile:
    """The file with `lines` added after the last entry of a section, or in a new section at its end."""
    end = "\r\n" if file.lines[0].endswith("\r\n") else "\n"
    last = max((entry.line for entry in file.entries if entry.section == section), default=None)
    if last is None:
        last, lines = len(file.lines), [f"[{section}]", *lines]
    before = list(file.lines[:last])
    if not before[-1].endswith(("\n", "\r")):
        before[-1] += end
    return kit.parse_property_file("".join([*before, *(line + end for line in lines), *file.lines[last:]]), file.source)


def _with_note(file: PropertyFile, note: str) -> PropertyFile:
    """The file with comment lines under its first heading (other readers may expect that heading in the first line)."""
    if not note:
        return file
    end = "\r\n" if file.lines[0].endswith("\r\n") else "\n"
    heading = next(i for i, line in enumerate(file.lines) if line.lstrip().startswith("["))
    comments = [f"$ {line}".rstrip() + end for line in note.splitlines()]
    lines = [*file.lines[: heading + 1], *comments, *file.lines[heading + 1 :]]
    return kit.parse_property_file("".join(lines), file.source)
