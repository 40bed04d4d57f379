"""The tyre of the car's other side: the same tyre, seen in a mirror."""

from __future__ import annotations

from typing import Any

from jaxveh._core.errors import InputError
from jaxveh.tyres.base import AbstractDynamicTyre, AbstractTyre, Contact, Forces

ODD_INPUTS = ("slip_angle", "camber", "turn_slip", "lateral_slip")
"""What of a contact changes sign in the mirror of the wheel's x-z plane; all else stays."""


def mirrored_contact(contact: Contact) -> Contact:
    """The contact, seen in a mirror."""
    odd = {name: getattr(contact, name) for name in ODD_INPUTS}
    return contact._replace(**{name: -value for name, value in odd.items() if value is not None})


class Mirrored(AbstractTyre):
    """A tyre mounted on the other side than the one it was measured on.

    In a mirror slip angle, camber, turn slip, F_y, M_x and M_z change sign. Tyres are hardly ever symmetric: ply-steer and
    conicity push both tyres of an axle towards the same side of the car where one law serves both wheels, and against each
    other where one of them is mirrored. The parameters are those of `tyre`, one set however many wheels it serves.

    **Raises** `InputError` for a tyre with states, whose mirror image is made before it gets them: `Relaxed(Mirrored(tyre))`.
    """

    tyre: AbstractTyre

    def __check_init__(self):
        if isinstance(self.tyre, AbstractDynamicTyre):
            raise InputError(
                f"Mirrored.tyre = {type(self.tyre).__name__}: must be a tyre without states; mirror the tyre within it."
            )

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """Forces (N) and moments (N m) at a contact, in the axes of the wheel as it is mounted."""
        found = self.tyre.forces(mirrored_contact(contact), state)
        return found._replace(F_y=-found.F_y, M_x=-found.M_x, M_z=-found.M_z)
