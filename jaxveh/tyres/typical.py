"""Tyres to start from if only size and load are known."""

from __future__ import annotations

import dataclasses

from jaxveh._core.errors import check_flags, check_positive
from jaxveh.tyres import mf_tyre
from jaxveh.tyres.mf_tyre import MFTyre
from jaxveh.tyres.mf_tyre.typical import TYPICAL_COEFFICIENTS

SLIP_RATIO = 1.5
"""The limit of the slip ratio in both directions, as in most property files."""


def typical_mf_tyre(
    load, *, version: int = 61, pressure=220000.0, radius=0.32, speed=16.7, limits: bool = True
) -> MFTyre:
    """A typical car tyre as MF-Tyre `version` (52, 61 or 62): a start for fits, not a measured tyre.

    `load` (N) is its nominal load, `pressure` (Pa) its nominal and inflation pressure, `radius` (m) its unloaded radius, `speed`
    (m/s) its nominal measurement speed LONGVL; `limits`: as in `MFTyre`. The coefficients are the defaults of a property file,
    `mf_tyre.typical.TYPICAL_COEFFICIENTS`; forces scale with the load.

    **Raises** `InputError` for numbers that are not positive, and for an unknown version.
    """
    check_flags(limits=limits)
    for name, value, unit in (
        ("load", load, "N"), ("pressure", pressure, "Pa"), ("radius", radius, "m"), ("speed", speed, "m/s"),
    ):  # fmt: skip
        check_positive(f"typical_mf_tyre: {name}", value, unit)
    own = {"FNOMIN": load, "NOMPRES": pressure, "INFLPRES": pressure, "UNLOADED_RADIUS": radius, "LONGVL": speed}
    known = {**TYPICAL_COEFFICIENTS, **own, "KPUMIN": -SLIP_RATIO, "KPUMAX": SLIP_RATIO}

    def section(kind):
        return kind(**{field.name: known[field.name] for field in dataclasses.fields(kind) if field.name in known})

    parts = (
        mf_tyre.Structure,
        mf_tyre.LongitudinalCoefficients,
        mf_tyre.LateralCoefficients,
        mf_tyre.AligningCoefficients,
        mf_tyre.OverturningCoefficients,
        mf_tyre.RollingCoefficients,
        mf_tyre.Scaling,
        mf_tyre.Ranges,
        mf_tyre.TurnSlip,
    )
    return MFTyre(*map(section, parts), version=version, limits=limits)
