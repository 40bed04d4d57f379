"""A tyre with its own road friction: friction as a parameter of the model instead of an input."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_static


class OnRoad(AbstractTyre):
    """`tyre` with the contact's friction multiplied by `friction` (-), a positive parameter.

    A contact already has the road's friction. This wrapper adds a friction that is a parameter and can be estimated or fitted
    for each axle (`lambda car: car.front.friction`). Its effect depends on the wrapped law: in `Brush`, `Dugoff`, `Fiala` and
    `MFTyre` friction bounds the force; in `MagicFormula` it scales the whole curve, slope included (`Similarity` around it
    keeps the slope). `Linear` does not use it: by the similarity rule a law without a limit does not change. A dynamic tyre
    wraps the tyre on its road: `Relaxed(OnRoad(tyre, 0.5), ...)`. `LuGre` has its own friction parameters.

    **Raises** `InputError` for a friction that is not positive, or a tyre with states.
    """

    tyre: AbstractTyre
    friction: jax.Array = positive("-")

    def __check_init__(self):
        need_static("OnRoad.tyre", self.tyre)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The wrapped tyre's forces (N) and moments (N m)."""
        return self.tyre.forces(contact._replace(friction=self.friction * contact.friction))
