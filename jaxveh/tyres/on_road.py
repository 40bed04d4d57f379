"""A tyre on a road of its own: friction as a parameter of the model instead of an input."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_static


class OnRoad(AbstractTyre):
    """`tyre` with the contact's friction multiplied by `friction` (-), a positive parameter.

    A contact carries the road's friction already; this makes it a leaf, to be estimated or fitted for each axle
    (`lambda car: car.front.friction`). What friction does is the wrapped law's affair: `Brush`, `Dugoff`, `Fiala` and `MFTyre`
    bound their force by it, `MagicFormula` scales its whole curve, slope included (`Similarity` around it keeps the slope).
    `Linear` does not use it: by the similarity rule a law without a limit stays as it is. A dynamic tyre takes its road
    inside: `Relaxed(OnRoad(tyre, 0.5), ...)`; `LuGre` has friction of its own.

    **Raises** `InputError` for a friction that is not positive, or a tyre with states.
    """

    tyre: AbstractTyre
    friction: jax.Array = positive("-")

    def __check_init__(self):
        need_static("OnRoad.tyre", self.tyre)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The wrapped tyre's forces (N) and moments (N m)."""
        return self.tyre.forces(contact._replace(friction=self.friction * contact.friction))
