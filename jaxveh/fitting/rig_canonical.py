"""Twins of an MF-Tyre: different sets of coefficients that give the same tyre; one of them is reported.

The Magic Formula consists of odd functions within odd ones and of even functions. So some coefficients may change their sign
together without any change of the forces: `cos(arctan(RBY2 x))` is even, and `sin(RVY5 arctan(RVY6 x))` stays the same where
both factors change their sign. A fit ends in whichever twin its start is near; a standard error does not include the distance
to the others.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import equinox as eqx

from jaxveh._core.errors import check_kind
from jaxveh._core.host import on_host
from jaxveh._core.names import as_names
from jaxveh.fitting.rig_data import leaf_of
from jaxveh.tyres import MFTyre


class Twin(NamedTuple):
    """Coefficients that change their sign together; in the reported form `lead` is positive."""

    lead: str
    others: tuple[str, ...] = ()

    @property
    def members(self) -> tuple[str, ...]:
        """All coefficients of the twin."""
        return (self.lead, *self.others)


def _twin(section: str, names: str) -> Twin:
    first, *rest = (name if "." in name else f"{section}.{name}" for name in names.split())
    return Twin(first, tuple(rest))


_SIDE = "RVY1 RVY2 RVY3"

TWINS = (
    # B = K / (C D): a change of sign of C or D changes that of B, and the sine curve is odd in it.
    _twin("longitudinal", "PCX1"),
    _twin("longitudinal", "PDX1 PDX2"),
    _twin("lateral", "PCY1"),
    # Friction scales the effect of slip ratio on F_y; B C = K / D scales the residual torque's slope.
    _twin("lateral", f"PDY1 PDY2 {_SIDE} aligning.QBZ10"),
    # K = PKY1 F sin(PKY4 arctan(F_z / (F (PKY2 + PKY5 g^2)))), where g is the sine of camber.
    _twin("lateral", "PKY4 PKY1"),
    _twin("lateral", "PKY2 PKY5 PKY1"),
    # Weights of combined slip: a cosine of an odd function, whose slope is also a cosine.
    _twin("longitudinal", "RBX1 RBX3"),
    _twin("longitudinal", "RBX2"),
    _twin("longitudinal", "RCX1"),
    _twin("lateral", "RBY1 RBY4"),
    _twin("lateral", "RBY2"),
    _twin("lateral", "RCY1"),
    # Effect of slip ratio: (RVY1 + ...) cos(arctan(RVY4 a)) sin(RVY5 arctan(RVY6 k)).
    _twin("lateral", "RVY4"),
    _twin("lateral", f"RVY5 {_SIDE}"),
    _twin("lateral", f"RVY6 {_SIDE}"),
    # Trail: a cosine curve whose curvature contains arctan(B C a). Residual torque: cos(arctan(B a)).
    _twin("aligning", "QCZ1 QEZ4 QEZ5"),
    _twin("aligning", "QBZ1 QBZ2 QBZ3 QEZ4 QEZ5"),
    _twin("aligning", "QBZ9 QBZ10"),
    # M_x: QSX4 cos(QSX5 arctan((QSX6 f)^2)) sin(QSX7 g + QSX8 arctan(QSX9 y)) + QSX10 arctan(QSX11 f) g.
    _twin("overturning", "QSX5"),
    _twin("overturning", "QSX6"),
    _twin("overturning", "QSX4 QSX7 QSX8"),
    _twin("overturning", "QSX9 QSX8"),
    _twin("overturning", "QSX11 QSX10"),
)
"""All sign twins of versions 5.2, 6.1 and 6.2 that a rig without turn slip shows; others are products of them."""


@on_host
def canonical(tyre: MFTyre, fixed: Collection[str] = ()) -> MFTyre:
    """The twin of a tyre whose leading coefficients are positive (`TWINS`); its forces and moments are the same.

    `fixed`: names of coefficients that must not change, such as those that a user holds or bounds; a twin that would change the
    sign of one of them, unless it is zero, is skipped. A leading coefficient of zero stays.
    """
    check_kind("tyre", tyre, MFTyre)
    fixed = as_names(fixed, "fixed") or ()
    # No twin changes the lead of another one: no lead is in another twin's `others`.
    for twin in TWINS:
        if float(leaf_of(tyre, twin.lead)) >= 0:
            continue
        if any(name in fixed and float(leaf_of(tyre, name)) != 0 for name in twin.members):
            continue
        names = twin.members
        turned = [0.0 - leaf_of(tyre, name) for name in names]
        tyre = eqx.tree_at(lambda law, names=names: [leaf_of(law, name) for name in names], tyre, turned)
    return tyre
