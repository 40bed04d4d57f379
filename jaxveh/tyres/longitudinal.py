"""A lateral law used for longitudinal slip: the force along the wheel from the slip ratio."""

from __future__ import annotations

from typing import Any

from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_static


class LongitudinalLaw(AbstractTyre):
    """`F_x` (N) is the `F_y` of a lateral `law` at `slip_angle = slip_ratio`: its coefficients "per rad" are per unit slip.

    `LongitudinalLaw(MagicFormula(...))` is the Magic Formula of longitudinal slip. Slip angle and camber have no effect; the law
    gets the contact's load, friction, speed and pressure.

    **Raises** `InputError` for a law that is not a tyre or that has states.
    """

    law: AbstractTyre

    def __check_init__(self):
        need_static("LongitudinalLaw.law", self.law)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The longitudinal force only, N."""
        turned = contact._replace(slip_angle=contact.slip_ratio, lateral_slip=None, slip_ratio=0.0, camber=0.0)
        return Forces(F_x=self.law.forces(turned).F_y)
