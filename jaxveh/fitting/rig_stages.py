"""The order in which a tyre is fitted to rig data: pure slip first, then combined slip, then moments."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from jaxveh.io import RigTable
from jaxveh.tyres import AbstractTyre, MFTyre

PURE_ANGLE, PURE_RATIO = np.radians(0.5), 0.01
"""Slip angle (rad) and slip ratio below which a row counts as pure slip of the other kind."""

LEAST_SPREAD = {
    "slip_angle": np.radians(1.0), "slip_ratio": 0.02, "camber": np.radians(0.5), "load": 0.15, "pressure": 0.05, "speed": 0.1,
}  # fmt: skip
"""The least variation of an input (from its 2nd to its 98th percentile) to show its coefficients; for the last three relative
to their median."""


CURVATURES, SHAPES = (-3.0, -1.0, 0.5, 0.7, 0.9), (0.9,)

STARTS = {
    "longitudinal.PEX1": CURVATURES,
    "longitudinal.REX1": CURVATURES,
    "longitudinal.RCX1": SHAPES,
    "lateral.PEY1": CURVATURES,
    "lateral.REY1": CURVATURES,
    "lateral.RCY1": SHAPES,
    "aligning.QEZ1": CURVATURES,
    "overturning.QSX5": (0.3,),
    "overturning.QSX6": (1.0,),
    "overturning.QSX8": (-1.0, 1.0),
}
"""Other starting values of coefficients. Curvatures E end at 1, beyond which no data pull them back, and a fit from one start
may stop there; in combined slip the shape C has a good end on either side of 1; a typical tyre's M_x has factors of zero,
which hide the coefficients that they multiply."""


HELD_COEFFICIENTS = {"lateral.PKY4": 0.5}
"""Coefficients that are held at the law's value by default, and their standard deviation about it among ordinary tyres. PKY4,
the form of the cornering stiffness over load, is 2 in the book's simple form (4.E25); next to PKY1 and PKY2 the three or four
loads of a rig hardly show it, and all three run along one valley."""


class Stage(NamedTuple):
    """One fit: its `name`, the `channels` that it compares, the names of its coefficients, and which rows count (n,).

    `starts`: coefficients and other values from which the stage starts, in every combination; the best end is taken. `aside`:
    those of `HELD_COEFFICIENTS` that belong to this stage and are not to be fitted.
    """

    name: str
    channels: tuple[str, ...]
    coefficients: tuple[str, ...]
    rows: np.ndarray
    starts: tuple[tuple[str, tuple[float, ...]], ...] = ()
    aside: tuple[str, ...] = ()


class CoefficientGroup(NamedTuple):
    """Coefficients that one force or moment shows: always, and where load, camber or pressure vary (names separated by blanks).

    Those of `asked` show where the load varies, and are fitted only if the user names them (`HELD_COEFFICIENTS`).
    """

    section: str
    channel: str
    always: str
    load: str = ""
    camber: str = ""
    pressure: str = ""
    speed: str = ""
    asked: str = ""

    def identifiable(self, varies: set[str], asked: Collection[str] = ()) -> tuple[str, ...]:
        """The coefficients that data show in which these inputs vary, and those among `asked`, by their full names."""
        found = self.always.split() + [name for name in self.asked.split() if f"{self.section}.{name}" in asked]
        for name in ("load", "camber", "pressure", "speed"):
            found += getattr(self, name).split() if name in varies else []
        return tuple(f"{self.section}.{name}" for name in found)

    def aside(self, varies: set[str], free: Collection[str]) -> tuple[str, ...]:
        """The coefficients that data would show in which these inputs vary, and that the user did not let `free`."""
        names = (f"{self.section}.{name}" for name in self.asked.split())
        return tuple(name for name in names if "load" in varies and name not in free)


ALONG = CoefficientGroup(
    "longitudinal", "F_x", "PCX1 PDX1 PEX1 PEX4 PKX1 PHX1 PVX1", "PDX2 PEX2 PEX3 PKX2 PKX3 PHX2 PVX2", "PDX3",
    "PPX1 PPX2 PPX3 PPX4",
)  # fmt: skip
ALONG_52 = ALONG._replace(pressure="")
ALONG_COMBINED = CoefficientGroup("longitudinal", "F_x", "RBX1 RBX2 RCX1 REX1 RHX1", "REX2", "RBX3")
ACROSS = CoefficientGroup(
    "lateral", "F_y", "PCY1 PDY1 PEY1 PEY3 PKY1 PHY1 PVY1", "PDY2 PEY2 PKY2 PHY2 PVY2",
    "PDY3 PEY4 PEY5 PKY3 PKY5 PKY6 PKY7 PVY3 PVY4", "PPY1 PPY2 PPY3 PPY4 PPY5", asked="PKY4",
)  # fmt: skip

ACROSS_52 = CoefficientGroup(
    "lateral", "F_y", "PCY1 PDY1 PEY1 PEY3 PKY1 PHY1 PVY1", "PDY2 PEY2 PKY2 PHY2 PVY2", "PDY3 PEY4 PKY3 PHY3 PVY3 PVY4"
)  # fmt: skip
ACROSS_COMBINED = CoefficientGroup(
    "lateral", "F_y", "RBY1 RBY2 RBY3 RCY1 REY1 RHY1 RVY1 RVY4 RVY5 RVY6", "REY2 RHY2 RVY2", "RBY4 RVY3"
)
ALIGNING = CoefficientGroup(
    "aligning", "M_z", "QBZ1 QBZ9 QCZ1 QDZ1 QDZ6 QEZ1 QEZ4 QHZ1", "QBZ2 QBZ3 QDZ2 QDZ7 QEZ2 QEZ3 QHZ2",
    "QBZ4 QBZ5 QDZ3 QDZ4 QDZ8 QDZ9 QDZ10 QDZ11 QEZ5 QHZ3 QHZ4", "PPZ1 PPZ2",
)  # fmt: skip
ALIGNING_52 = ALIGNING._replace(camber="QBZ4 QBZ5 QDZ3 QDZ4 QDZ8 QDZ9 QEZ5 QHZ3 QHZ4", pressure="")
ALIGNING_COMBINED = CoefficientGroup("aligning", "M_z", "SSZ1 SSZ2", "", "SSZ3 SSZ4")
OVERTURNING = CoefficientGroup(
    "overturning", "M_x", "QSX1 QSX3 QSX4 QSX8 QSX9", "QSX5 QSX6", "QSX2 QSX7 QSX10 QSX11", "PPMX1"
)
OVERTURNING_52 = CoefficientGroup("overturning", "M_x", "QSX1 QSX3", "", "QSX2")
ROLLING = CoefficientGroup("rolling", "M_y", "QSY1", "QSY7", "QSY5 QSY6", "QSY8", "QSY3 QSY4")
ROLLING_52 = CoefficientGroup("rolling", "M_y", "QSY1", "", "", "", "QSY3 QSY4")


def varying_inputs(rig: RigTable) -> set[str]:
    """The inputs that vary enough to show their coefficients."""
    found = set()
    for name, least in LEAST_SPREAD.items():
        values = getattr(rig, name)
        if values is None:
            continue
        low, high = np.percentile(values, [2, 98])
        size = abs(np.median(values)) if name in ("load", "pressure", "speed") else 1.0
        if high - low > least * max(size, 1e-12):
            found.add(name)
    return found


def stages_of(
    law: AbstractTyre,
    rig: RigTable,
    measured: tuple[str, ...],
    chosen: tuple[str, ...] | None,
    free: Collection[str] = (),
) -> list[Stage]:
    """The stages for a law and data. The coefficients are those `chosen` by the user, if given, otherwise those that data show
    and those that the user lets `free`.

    A law other than MF-Tyre is fitted at once, all its parameters to all its forces.
    """
    if not isinstance(law, MFTyre):
        return []
    varies = varying_inputs(rig)
    every = np.ones(rig.load.shape, bool)
    across, along = np.abs(rig.slip_angle) <= PURE_ANGLE, np.abs(rig.slip_ratio) <= PURE_RATIO
    old = law.version == 52
    plan = [
        ("F_x, pure", ALONG_52 if old else ALONG, across, "slip_ratio"),
        ("F_y, pure", ACROSS_52 if old else ACROSS, along, "slip_angle"),
        ("F_x, combined", ALONG_COMBINED, every, "both"),
        ("F_y, combined", ACROSS_COMBINED, every, "both"),
        ("M_z", ALIGNING_52 if old else ALIGNING, every, "slip_angle"),
        ("M_z, combined", ALIGNING_COMBINED, every, "both"),
        ("M_x", OVERTURNING_52 if old else OVERTURNING, every, "slip_angle"),
        ("M_y", ROLLING_52 if old else ROLLING, every, ""),
    ]
    combined = bool(np.any(~across & ~along)) and {"slip_angle", "slip_ratio"} <= varies
    found = []
    for name, group, rows, needs in plan:
        shown = combined if needs == "both" else (not needs or needs in varies)
        if group.channel not in measured or not shown:
            continue
        # Rows of pure slip show their coefficients alone; if none of them was measured, all rows are used.
        seen = np.isfinite(getattr(rig, group.channel))
        rows = rows & seen if np.any(rows & seen) else seen
        names = group.identifiable(varies, free if chosen is None else chosen)
        names = names if chosen is None else tuple(name for name in names if name in chosen)
        if names:
            starts = tuple((one, STARTS[one]) for one in names if one in STARTS)
            aside = () if chosen is not None else group.aside(varies, free)
            found.append(Stage(name, (group.channel,), names, rows, starts, aside))
    return found
