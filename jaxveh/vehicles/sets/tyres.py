"""Tyre models from a few numbers."""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax.numpy as jnp

from jaxveh.tyres import AbstractTyre, MagicFormula, MFTyre, from_property_file, kit, mf_tyre, typical_mf_tyre
from jaxveh.vehicles.sets.numbers import TyreNumbers

STRAIGHT = 1e4
"""The multiple of the nominal load at which stiffness is greatest: so large that stiffness is proportional to any real load."""

SHIFTS = ("PHX1", "PVX1", "PHY1", "PVY1")
"""The coefficients of a tyre's forces at zero slip; left out of cars whose right tyres are mirror images of the left ones."""


def wheel_tyre(numbers: TyreNumbers, load: float, radius: float | None = None) -> AbstractTyre:
    """The tyre of one wheel, for combined slip and any load.

    If the numbers name a property file, it is the tyre of that file; if they have coefficients, it is an MF-Tyre 5.2 without
    shifts. Otherwise it is a typical MF-Tyre 6.1 with their stiffnesses and friction at the static `load` (N). `radius` (m) is
    that of the wheel, by default 0.32.
    """
    radius = 0.32 if radius is None else radius
    if numbers.property_file is not None:
        return from_property_file(numbers.property_file)
    if numbers.coefficients is not None:
        return _pac2002(numbers.coefficients, load, radius)
    tyre = typical_mf_tyre(load, radius=radius)
    along = numbers.cornering_stiffness if numbers.slip_stiffness is None else numbers.slip_stiffness
    scales = {
        "LKY": numbers.cornering_stiffness / (-kit.TYPICAL_COEFFICIENTS["PKY1"] * load),
        # The camber stiffness scales with the cornering stiffness, since both are of one carcass. With that of the typical tyre a
        # softened front axle would have twice the camber thrust of the rear, and a rolling car 8 % less yaw gain.
        "LKYC": numbers.cornering_stiffness / (-kit.TYPICAL_COEFFICIENTS["PKY1"] * load),
        "LKX": along / (kit.TYPICAL_COEFFICIENTS["PKX1"] * load),
        "LMUX": numbers.friction / kit.TYPICAL_COEFFICIENTS["PDX1"],
        "LMUY": numbers.friction / kit.TYPICAL_COEFFICIENTS["PDY1"],
        # Rolling resistance is a parameter of the car.
        "LMY": 0.0,
    }
    return eqx.tree_at(
        lambda t: [getattr(t.scaling, name) for name in scales], tyre, [jnp.asarray(v, float) for v in scales.values()]
    )


def axle_tyre(numbers: TyreNumbers, load: float) -> MagicFormula:
    """Both tyres of an axle as one Magic Formula: the `axle_formula` of the numbers if there is one, otherwise one with their
    stiffness and friction at the axle's static `load` (N) and the shape of an ordinary tyre (`tyres.kit.GENERIC_TYRE`), with
    the force proportional to load."""
    if numbers.axle_formula is not None:
        return MagicFormula(*numbers.axle_formula)
    return kit.GENERIC_TYRE.magic_formula(2.0 * numbers.cornering_stiffness, load, numbers.friction)


def _pac2002(coefficients, load: float, radius: float) -> MFTyre:
    known = {name: value for name, value in coefficients.items() if name not in SHIFTS}
    known |= {"FNOMIN": load, "UNLOADED_RADIUS": radius, "PKY1": known["PKY1"] * STRAIGHT / 2.0, "PKY2": STRAIGHT}

    def section(kind):
        return kind(**{entry.name: known[entry.name] for entry in dataclasses.fields(kind) if entry.name in known})

    parts = (
        mf_tyre.Structure, mf_tyre.LongitudinalCoefficients, mf_tyre.LateralCoefficients, mf_tyre.AligningCoefficients,
        mf_tyre.OverturningCoefficients, mf_tyre.RollingCoefficients, mf_tyre.Scaling, mf_tyre.Ranges,
    )  # fmt: skip
    return MFTyre(*map(section, parts), version=52)
