"""An ordinary tyre, where nobody has measured one: the one set of numbers for what a file leaves out."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh.tyres.magic_formula import MagicFormula


class GenericTyre(NamedTuple):
    """`friction` coefficient and shape (`C`, `E`) of an ordinary tyre's Magic Formula; `stiffness` over load (1/rad, or per slip
    ratio)."""

    friction: float = 1.0
    C: float = 1.3
    E: float = -0.5
    stiffness: float = 15.0

    def magic_formula(self, stiffness: Any, load: Any, friction: Any = None) -> MagicFormula:
        """A Magic Formula of a cornering stiffness (N/rad), or slip stiffness (N), at a load (N); with this tyre's friction
        unless another is known.

        Peak force D is friction times load, `B = stiffness / (C D)`; force scales with load (`nominal_load` is the load).
        """
        D = (self.friction if friction is None else friction) * load
        return MagicFormula(B=stiffness / (self.C * D), C=self.C, D=D, E=self.E, nominal_load=load)


GENERIC_TYRE = GenericTyre()
"""What drawing and fitting take alike."""
