"""Force laws of one wheel (or one axle) at one instant: contact in, forces out."""

from jaxveh.tyres.base import AbstractDynamicTyre, AbstractTyre, Contact, Forces, cornering_stiffness
from jaxveh.tyres.brush import Brush
from jaxveh.tyres.dugoff import Dugoff
from jaxveh.tyres.fiala import Fiala
from jaxveh.tyres.friction_ellipse import FrictionEllipse
from jaxveh.tyres.linear import Linear
from jaxveh.tyres.longitudinal import Longitudinal
from jaxveh.tyres.lugre import LuGre
from jaxveh.tyres.magic_formula import MagicFormula
from jaxveh.tyres.mf_tyre import MFOutputs, MFTyre
from jaxveh.tyres.on_road import OnRoad
from jaxveh.tyres.property_file import from_property_file
from jaxveh.tyres.relaxed import Relaxed
from jaxveh.tyres.similarity import Similarity

__all__ = [
    "AbstractDynamicTyre",
    "AbstractTyre",
    "Brush",
    "Contact",
    "Dugoff",
    "Fiala",
    "Forces",
    "FrictionEllipse",
    "Linear",
    "Longitudinal",
    "LuGre",
    "MFOutputs",
    "MFTyre",
    "MagicFormula",
    "OnRoad",
    "Relaxed",
    "Similarity",
    "cornering_stiffness",
    "from_property_file",
]
