"""A mirrored tyre: the same tyre on the other side of the car."""

from __future__ import annotations

from typing import Any

from jaxveh._core.errors import InputError, word_for
from jaxveh.tyres.base import AbstractDynamicTyre, AbstractTyre, Contact, Forces

ODD_INPUTS = ("slip_angle", "camber", "turn_slip", "lateral_slip")
"""The fields of a contact that change sign when it is mirrored in the wheel's x-z plane; all others stay the same."""


def mirrored_contact(contact: Contact) -> Contact:
    """The contact, mirrored in the wheel's x-z plane."""
    odd = {name: getattr(contact, name) for name in ODD_INPUTS}
    return contact._replace(**{name: -value for name, value in odd.items() if value is not None})


class Mirrored(AbstractTyre):
    """A tyre mounted on the other side of the car than the one for which it was measured.

    Mirroring changes the signs of slip angle, camber, turn slip, F_y, M_x and M_z. Tyres are hardly ever symmetric: if one law
    is used for both wheels of an axle, ply-steer and conicity push both towards the same side of the car; if one of them is
    mirrored, they push against each other. The parameters are those of `tyre`, one set for all wheels that use it.

    **Raises** `InputError` for a tyre with states. Mirror the static tyre inside it instead: `Relaxed(Mirrored(tyre))`.
    """

    tyre: AbstractTyre

    def __check_init__(self):
        if isinstance(self.tyre, AbstractDynamicTyre):
            raise InputError(
                f"Mirrored.tyre = {word_for(self.tyre)}: must be a tyre without states; mirror the tyre inside it."
            )

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The forces (N) and moments (N m) at a contact, in the axes of the mounted wheel."""
        found = self.tyre.forces(mirrored_contact(contact), state)
        return found._replace(F_y=-found.F_y, M_x=-found.M_x, M_z=-found.M_z)
