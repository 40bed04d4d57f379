"""The signs of rig data in the four conventions that tyre files come in, and their way to those of this package.

All four have x forward. Forces and moments are those that the road exerts on the tyre, the camber is the wheel's inclination
about x, positive where its top leans to the right, in each of them:

| | y, z | slip angle positive, the force of a tyre is | load of a wheel on the ground | F_y by a positive camber |
| --- | --- | --- | --- | --- |
| `sae` | right, down | where the contact point moves to the right; negative | F_z negative | positive |
| `adapted-sae` | right, down | where it moves to the left; positive | positive, `F_N` | positive |
| `iso-w` | left, up | where it moves to the left; negative | F_z positive | negative |
| `ours` | left, up | where it moves to the right; positive | F_z positive | negative |

Sources: SAE J670 (2008) for SAE's tyre axes; ISO 8855 and the W axes of TYDEX (Unrau & Zamow 1997) for ISO-W; H. B. Pacejka,
Tire and Vehicle Dynamics (2012), appendix 1, which draws SAE, ISO and adapted SAE side by side, the last being the book's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

AXES = ("sae", "adapted-sae", "iso-w", "ours")

TURNED = ("F_y", "M_y", "M_z")
"""What changes its sign between z down and z up, a turn of half a circle about x; slips and the camber about x do not."""

FLIPS = {
    "sae": ("load", *TURNED),
    "adapted-sae": ("slip_angle", *TURNED),
    "iso-w": ("slip_angle",),
    "ours": (),
}
"""By convention, the columns of a rig table whose sign is the other one here."""


def to_ours(columns: Mapping[str, Any], axes: str) -> dict[str, Any]:
    """Columns of a rig table by field, (n,) each or None, from the signs of `axes` to those of this package."""
    turned = {name: 0.0 - values for name in FLIPS[axes] if (values := columns.get(name)) is not None}
    return {**columns, **turned}
