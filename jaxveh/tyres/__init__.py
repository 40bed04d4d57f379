"""Force laws of one wheel (or one axle) at one instant: contact in, forces out."""

from jaxveh.tyres.base import AbstractDynamicTyre, AbstractTyre, Contact, Forces, cornering_stiffness
from jaxveh.tyres.brush import Brush
from jaxveh.tyres.dugoff import Dugoff
from jaxveh.tyres.fiala import Fiala
from jaxveh.tyres.linear import Linear
from jaxveh.tyres.magic_formula import MagicFormula
from jaxveh.tyres.mf_tyre import MFOutputs, MFTyre
from jaxveh.tyres.mirrored import Mirrored
from jaxveh.tyres.property_check import Finding, check_property_file
from jaxveh.tyres.property_file import from_property_file

__all__ = [
    "AbstractDynamicTyre",
    "AbstractTyre",
    "Brush",
    "Contact",
    "Dugoff",
    "Fiala",
    "Finding",
    "Forces",
    "Linear",
    "MFOutputs",
    "MFTyre",
    "MagicFormula",
    "Mirrored",
    "check_property_file",
    "cornering_stiffness",
    "from_property_file",
]
