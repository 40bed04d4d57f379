"""The start of a fit to rig data: a law by its name, with coefficients estimated from the data."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_kind, check_one_of
from jaxveh.fitting.rig_signs import SMALL, wrong_signs
from jaxveh.fitting.rig_stages import LEAST_SPREAD
from jaxveh.io import RigTable
from jaxveh.tyres import (
    HSRI,
    AbstractTyre,
    Brush,
    Dugoff,
    Fiala,
    LinearWithLoad,
    MagicFormula,
    UniTire,
    kit,
    typical_mf_tyre,
)

LEAST_ROWS = 5
"""The least number of rows for a slope; where fewer have a small slip, that many of the smallest are used."""

LEAST_LOAD = 0.2
"""Share of the median load below which a row is not used for friction: there it is noise divided by a small load."""

NEAR_LOAD = 1.4
"""Rows with loads within this factor of the median give the slope; other loads are used only if there are too few."""

GENERIC_RIG = {"speed": 16.7, "pressure": 220000.0}
"""m/s and Pa, used if the data do not have them."""


class RigFacts(NamedTuple):
    """Simple facts from rig data: the median `load` (N), `pressure` (Pa) and `speed` (m/s); `cornering_stiffness` (N/rad)
    and `slip_stiffness` (N) at that load; `friction`, the largest force over load."""

    load: float
    pressure: float
    speed: float
    cornering_stiffness: float
    slip_stiffness: float
    friction: float


def rig_facts(rig: RigTable) -> RigFacts:
    """Simple facts from rig data; an ordinary tyre's numbers where the data do not give them.

    A direction without measurements takes the other one's stiffness.
    """
    load = float(np.median(rig.load))
    median = lambda name: float(np.median(getattr(rig, name)) if getattr(rig, name) is not None else GENERIC_RIG[name])
    across, along = _slope(rig, "F_y", load), _slope(rig, "F_x", load)
    generic = kit.GENERIC_TYRE.stiffness * load
    # `speed` of a table may be zero if the rig did not record it.
    return RigFacts(
        load=load,
        pressure=median("pressure"),
        speed=median("speed") or GENERIC_RIG["speed"],
        cornering_stiffness=across or along or generic,
        slip_stiffness=along or across or generic,
        friction=_friction(rig, load),
    )


def _slope(rig: RigTable, channel: str, load: float) -> float | None:
    """The slope of a force over its slip at the median load, for small slips; None if it was not measured there."""
    force, share = getattr(rig, channel), rig.load / load
    name, other = ("slip_angle", "slip_ratio") if channel == "F_y" else ("slip_ratio", "slip_angle")
    slip = getattr(rig, name)
    # A slip that varies only by noise does not determine a slope.
    if force is None or np.ptp(np.percentile(slip, [2, 98])) < LEAST_SPREAD[name]:
        return None
    rows = np.isfinite(force) & (np.abs(getattr(rig, other)) <= SMALL[other]) & (slip != 0) & (share > LEAST_LOAD)
    near = rows & (share > 1 / NEAR_LOAD) & (share < NEAR_LOAD)
    rows = near if np.sum(near & (np.abs(slip) <= SMALL[name])) >= LEAST_ROWS else rows
    if rows.sum() < LEAST_ROWS:
        return None
    rows &= np.abs(slip) <= max(SMALL[name], np.sort(np.abs(slip[rows]))[LEAST_ROWS - 1])
    if np.ptp(slip[rows]) == 0:
        return None
    # A line with an offset (conicity, ply steer); the share of the load brings other loads near the median one.
    columns = np.stack([slip[rows], np.ones(rows.sum())], axis=1)
    slope = np.linalg.lstsq(columns, force[rows] / share[rows], rcond=None)[0][0]
    return float(slope) if slope > 0 else None


def _friction(rig: RigTable, load: float) -> float:
    parts = [np.nan_to_num(force) for force in (rig.F_x, rig.F_y) if force is not None]
    rows = rig.load > LEAST_LOAD * load
    if not parts or not np.any(rows):
        return kit.GENERIC_TYRE.friction
    share = np.hypot(parts[0], parts[-1] if len(parts) > 1 else 0.0)[rows] / rig.load[rows]
    # The very largest is an outlier's.
    return float(np.percentile(share, 99.5)) or kit.GENERIC_TYRE.friction


def _mf(version: int) -> Callable[[RigFacts], AbstractTyre]:
    def typical(facts: RigFacts) -> AbstractTyre:
        return typical_mf_tyre(facts.load, version=version, pressure=facts.pressure, speed=facts.speed)

    return typical


def _magic_formula(facts: RigFacts) -> MagicFormula:
    return kit.GENERIC_TYRE.magic_formula(facts.cornering_stiffness, facts.load, facts.friction)


def _linear_with_load(facts: RigFacts) -> LinearWithLoad:
    # Its stiffness is greatest at twice the median load; at the median it is 4/5 of that.
    return LinearWithLoad(1.25 * facts.cornering_stiffness, 2 * facts.load, facts.slip_stiffness / facts.load)


def _of_stiffness(law: type) -> Callable[[RigFacts], AbstractTyre]:
    return lambda facts: law(facts.slip_stiffness, facts.cornering_stiffness, facts.friction)


RIG_STARTS: dict[str, Callable[[RigFacts], AbstractTyre]] = {
    "mf61": _mf(61),
    "mf52": _mf(52),
    "mf62": _mf(62),
    "mf": _magic_formula,
    "brush": _of_stiffness(Brush),
    "dugoff": _of_stiffness(Dugoff),
    "fiala": _of_stiffness(Fiala),
    "unitire": _of_stiffness(UniTire),
    "linear-with-load": _linear_with_load,
    "hsri": _of_stiffness(HSRI),
}
"""Laws by their names in programs."""


def starting_tyre(model: str, rig: RigTable) -> AbstractTyre:
    """A law to start a fit from, by its name (`RIG_STARTS`).

    MF-Tyre (`mf61`, `mf52`, `mf62`) is `tyres.typical_mf_tyre` with the median load, pressure and speed of the data as nominal
    values. Others take their stiffnesses from the slope of forces at small slip, and their friction from the largest force
    over load.

    **Raises** `InputError` for an unknown name, and for a slope that no tyre has, as in data with other axes
    (`rig_signs.wrong_signs`): for a tyre that does have it, start from a tyre of your own.
    """
    check_one_of("model", model, tuple(RIG_STARTS))
    check_kind("rig", rig, RigTable, "io.read_rig_table reads one.")
    for wrong in wrong_signs(rig):
        raise InputError(f"{wrong.words} If they do, start from a tyre of your own (--start).")
    return RIG_STARTS[model](rig_facts(rig))
