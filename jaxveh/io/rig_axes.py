"""The signs of rig data in the four conventions of tyre files, and the conversion to those of this package.

All four have x forward. In each of them, forces and moments are those that the road exerts on the tyre, and the camber is the
wheel's inclination about x, positive if its top leans to the right:

| | y, z | slip angle positive, the force of a tyre is | load of a wheel on the ground | F_y by a positive camber |
| --- | --- | --- | --- | --- |
| `sae` | right, down | if the contact point moves to the right; negative | F_z negative | positive |
| `adapted-sae` | right, down | if it moves to the left; positive | positive, `F_N` | positive |
| `iso-w` | left, up | if it moves to the left; negative | F_z positive | negative |
| `ours` | left, up | if it moves to the right; positive | F_z positive | negative |

Sources: SAE J670 (2008) for SAE's tyre axes; ISO 8855 and the W axes of TYDEX (Unrau & Zamow 1997) for ISO-W; H. B. Pacejka,
Tire and Vehicle Dynamics (2012), appendix 1, which draws SAE, ISO and adapted SAE side by side; the book uses the last.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

AXES = ("sae", "adapted-sae", "iso-w", "ours")

TURNED = ("F_y", "M_y", "M_z")
"""Columns that change sign between z down and z up, a rotation by half a turn about x; slips and camber do not change."""

FLIPS = {
    "sae": ("load", *TURNED),
    "adapted-sae": ("slip_angle", *TURNED),
    "iso-w": ("slip_angle",),
    "ours": (),
}
"""The columns of a rig table whose sign is opposite in this package, by convention."""


def to_ours(columns: Mapping[str, Any], axes: str) -> dict[str, Any]:
    """Convert columns of a rig table by field, (n,) each or None, from the signs of `axes` to those of this package."""
    turned = {name: 0.0 - values for name in FLIPS[axes] if (values := columns.get(name)) is not None}
    return {**columns, **turned}
