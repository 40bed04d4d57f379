"""An ordinary tyre where there is no measured one: the set of numbers for values that a file leaves out."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh.tyres.magic_formula import MagicFormula


class GenericTyre(NamedTuple):
    """An ordinary tyre. `friction`: the friction coefficient of its Magic Formula; `C`, `E`: the shape and curvature factors of
    that; `stiffness`: the stiffness over load, 1/rad or per unit slip ratio."""

    friction: float = 1.0
    C: float = 1.3
    E: float = -0.5
    stiffness: float = 15.0

    def magic_formula(self, stiffness: Any, load: Any, friction: Any = None) -> MagicFormula:
        """A Magic Formula with the given cornering stiffness (N/rad) or slip stiffness (N) at a load (N).

        The friction is this tyre's unless `friction` is given. The peak force D is friction times load, and
        `B = stiffness / (C D)`. The force scales with load (`nominal_load` is the load).
        """
        D = (self.friction if friction is None else friction) * load
        return MagicFormula(B=stiffness / (self.C * D), C=self.C, D=D, E=self.E, nominal_load=load)


GENERIC_TYRE = GenericTyre()
"""The ordinary tyre that drawing and fitting both use."""
