"""Force laws of one wheel (or one axle) at one instant: contact in, forces out."""

from jaxveh.tyres.base import AbstractDynamicTyre, AbstractTyre, Contact, Forces, cornering_stiffness
from jaxveh.tyres.linear import Linear
from jaxveh.tyres.magic_formula import MagicFormula

__all__ = [
    "AbstractDynamicTyre",
    "AbstractTyre",
    "Contact",
    "Forces",
    "Linear",
    "MagicFormula",
    "cornering_stiffness",
]
